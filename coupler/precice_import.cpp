#include "precice_import.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <pugixml.hpp>
#include <set>

#include "precice_vocabulary.hpp"

namespace estuary::coupler {
namespace {

class Importer {
public:
  Importer(std::string name, const std::string& text, const std::map<std::string, std::string>& roles)
      : name_(std::move(name)), text_(text), given_roles_(roles) {}

  PreciceImport run() {
    const pugi::xml_parse_result parsed = document_.load_buffer(text_.data(), text_.size());
    if (!parsed)
      throw std::runtime_error(fmt::format("{}:{}: {}", name_, line_at(parsed.offset), parsed.description()));
    root_ = document_.child("precice-configuration");
    if (!root_) throw std::runtime_error(fmt::format("{}: has no <precice-configuration>", name_));
    // Version 2 has the rest one level deeper.
    if (const auto interface = root_.child("solver-interface")) {
      dimension_ = interface.attribute("dimensions").as_int(2);
      root_ = interface;
    }
    find_roles();
    find_grain_data();
    read_schemes();
    for (const auto& child : root_.children()) other(child);
    return {.scene = scene(), .notes = std::move(notes_)};
  }

private:
  std::size_t line_at(std::ptrdiff_t offset) const {
    const auto end = text_.begin() + std::clamp<std::ptrdiff_t>(offset, 0, std::ssize(text_));
    return static_cast<std::size_t>(1 + std::count(text_.begin(), end, '\n'));
  }
  void note(const pugi::xml_node& node, const std::string& what) {
    notes_.push_back(fmt::format("{}:{}: <{}>: {}", name_, line_at(node.offset_debug()), node.name(), what));
  }
  void coupling(const std::string& key, const std::string& value) { coupling_[key] = value; }

  // XML may say "1." or ".5", TOML may not. Nothing where there is no number, which is noted.
  std::optional<double> number(const pugi::xml_node& node, const char* attribute) {
    const std::string text = node.attribute(attribute).value();
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    if (text.empty() || end != text.c_str() + text.size() || !std::isfinite(value)) {
      note(node, fmt::format("`{}` is no number: '{}'", attribute, text));
      return {};
    }
    return value;
  }
  void coupling_number(const std::string& key, const pugi::xml_node& node) {
    if (const auto value = number(node, "value")) coupling(key, fmt::format("{}", *value));
  }

  // By its name, or else by what a participant writes.
  void find_roles() {
    std::set<std::string> taken;
    for (const auto& participant : root_.children("participant")) {
      const std::string name = participant.attribute("name").value();
      std::string role = role_of_name(name);
      for (const auto& data : participant.children("write-data")) {
        if (!role.empty()) break;
        const std::string field = field_of(data.attribute("name").value());
        if (field == "displacement" || field == "velocity") role = "solid";
        if (field == "force") role = "fluid";
      }
      if (const auto given = given_roles_.find(name); given != given_roles_.end()) role = given->second;
      if (role.empty() || !taken.insert(role).second) {
        throw std::runtime_error(fmt::format(
            "{}:{}: cannot tell which part '{}' plays{}; a scene has one fluid, one solid and one granular "
            "medium: say which it is with "
            "--role {}=fluid, solid or grains",
            name_, line_at(participant.offset_debug()), name,
            role.empty() ? std::string() : fmt::format(": another participant is the {} already", role),
            name));
      }
      roles_[name] = role;
    }
    if (roles_.size() < 2 || roles_.size() > 3)
      throw std::runtime_error(
          fmt::format("{}: has {} participants; a scene has two or three", name_, roles_.size()));
    for (const auto& [name, role] : given_roles_)
      if (!roles_.contains(name))
        throw std::runtime_error(fmt::format("{}: --role {}: there is no such participant", name_, name));
  }

  // What goes to or comes from the grains is no field of the wet surface.
  void find_grain_data() {
    for (const auto& scheme : root_.children())
      for (const auto& exchange : scheme.children("exchange"))
        for (const auto* end : {"from", "to"})
          if (roles_[exchange.attribute(end).value()] == "grains")
            grain_data_.insert(exchange.attribute("data").value());
  }

  // One scheme serves all participants: the first implicit one, or else the first.
  void read_schemes() {
    std::vector<pugi::xml_node> schemes;
    for (const auto& child : root_.children())
      if (family_of(child) == "coupling-scheme") schemes.push_back(child);
    if (schemes.empty()) throw std::runtime_error(fmt::format("{}: has no coupling scheme", name_));
    const auto implicit = std::find_if(schemes.begin(), schemes.end(), [](const auto& one) {
      return kind_of(one) == "multi" || kind_of(one).ends_with("implicit");
    });
    const auto chosen = implicit == schemes.end() ? schemes.begin() : implicit;
    for (auto one = schemes.begin(); one != schemes.end(); ++one)
      if (one != chosen)
        note(*one, fmt::format("a scene has one coupling scheme for all its participants: the {} of line {}",
                               kind_of(*chosen), line_at(chosen->offset_debug())));
    scheme(*chosen);
  }

  void scheme(const pugi::xml_node& node) {
    const std::string kind = kind_of(node);
    scheme_ = kind;
    const bool multi = kind == "multi";
    if (multi) {
      scheme_ = "parallel-implicit";
    } else if (kind != "serial-explicit" && kind != "parallel-explicit" && kind != "serial-implicit" &&
               kind != "parallel-implicit") {
      note(node, "no such scheme here; serial-implicit is taken");
      scheme_ = "serial-implicit";
    }
    coupling("scheme", fmt::format("\"{}\"", scheme_));
    std::optional<double> windows;
    bool accelerated = false;
    for (const auto& child : node.children()) {
      const std::string name = child.name();
      const auto value = child.attribute("value");
      if (name == "time-window-size" || name == "timestep-length") {
        window_ = value.as_double();
        if (!(window_ > 0))
          note(child, "the first participant's own time step cannot set the window; give `window`");
      } else if (name == "max-time") {
        end_time_ = value.as_double();
      } else if (name == "max-time-windows" || name == "max-timesteps") {
        windows = value.as_double();
      } else if (name == "max-iterations" || name == "min-iterations") {
        if (value.as_int() > 0) coupling(name.substr(0, 3) + "_iterations", value.value());
      } else if (name == "participants") {
        const std::string first = child.attribute("first").value();
        if (scheme_.starts_with("serial") && roles_[first] != "fluid")
          note(child, "in a serial scheme the fluid computes first here, then the solid");
      } else if (name == "participant" && multi) {
        if (child.attribute("control").as_bool())
          note(child, "the coupler is a process of its own: no participant controls");
      } else if (name == "exchange") {
        exchange(child);
      } else if (name.ends_with("convergence-measure")) {
        measure(child);
      } else if (family_of(child) == "acceleration" || family_of(child) == "post-processing") {
        accelerated = true;
        acceleration(child);
      } else {
        note(child, "has no counterpart");
      }
    }
    if (windows && !(end_time_ > 0)) end_time_ = *windows * window_;
    if (!accelerated && scheme_.ends_with("implicit")) coupling("acceleration", "\"none\"");
  }

  void exchange(const pugi::xml_node& node) {
    const std::string data = node.attribute("data").value();
    const std::string field = field_of(data);
    const std::string from = roles_[node.attribute("from").value()];
    if (grain_data_.contains(data)) {
      if (field.empty())
        note(node, fmt::format("'{}' does not travel here: grains give centres, velocities and spins, and "
                               "get forces and torques",
                               data));
    } else if (field.empty()) {
      note(node,
           fmt::format(
               "'{}' does not travel here: a solid gives displacements and velocities, a fluid pressures "
               "and tractions",
               data));
    } else if ((field == "force") == (from == "solid")) {
      note(node, fmt::format("'{}' goes from the {} the other way here", data, from));
    }
    if (lower(data).find("delta") != std::string::npos)
      note(node, fmt::format("'{}' are increments; here displacements are those since the start", data));
    if (node.attribute("substeps").as_bool())
      note(node,
           "values inside a window do not travel; a participant interpolates between the windows' ends");
  }

  void measure(const pugi::xml_node& node) {
    const std::string name = node.name();
    const std::string field = field_of(node.attribute("data").value());
    std::string kind = name.substr(0, name.size() - std::string_view("-convergence-measure").size());
    if (field.empty() || grain_data_.contains(node.attribute("data").value())) {
      note(node, fmt::format("'{}' is no field of the wet surface, which alone is measured",
                             node.attribute("data").value()));
      return;
    }
    const bool either = kind == "absolute-or-relative";
    if (either) {
      kind = "relative";
      note(node, "all measures must hold here: the relative one is taken, which is the stricter");
    }
    if (kind != "relative" && kind != "absolute" && kind != "residual-relative") {
      note(node, "has no counterpart");
      return;
    }
    for (const auto* attribute : {"suffices", "strict"})
      if (node.attribute(attribute).as_bool())
        note(node, fmt::format("`{}` has no counterpart: all measures must hold", attribute));
    const auto limit = number(node, either ? "rel-limit" : "limit");
    if (!limit) return;
    measures_.push_back(fmt::format("field = \"{}\"\nmeasure = \"{}\"\nlimit = {}\n", field, kind, *limit));
    measures_force_ |= field == "force";
  }

  void acceleration(const pugi::xml_node& node) {
    const std::string kind = lower(kind_of(node));
    if (kind != "constant" && kind != "aitken" && kind != "iqn-ils" && kind != "iqn-imvj") {
      note(node, "no such acceleration here; the default is taken");
      return;
    }
    coupling("acceleration", fmt::format("\"{}\"", kind));
    for (const auto& child : node.children()) {
      const std::string name = child.name();
      if (name == "relaxation" || name == "initial-relaxation") {
        coupling_number("relaxation", child);
      } else if (name == "max-used-iterations") {
        coupling_number("max_used_iterations", child);
      } else if (name == "time-windows-reused" || name == "timesteps-reused") {
        coupling_number("time_windows_reused", child);
      } else if (name == "filter") {
        const std::string type = lower(child.attribute("type").value());
        coupling("filter", fmt::format("\"{}\"", type.substr(0, 3)));
        if (type.size() > 3) note(child, fmt::format("'{}' is taken as '{}'", type, type.substr(0, 3)));
        if (child.attribute("limit")) filter_limit(child);
      } else if (name == "preconditioner") {
        const std::string type = child.attribute("type").value();
        if (type == "residual-sum") {
          coupling("preconditioner", "\"residual-sum\"");
        } else {
          note(child,
               fmt::format("'{}' is not known; `preconditioner` is \"residual-sum\" or \"none\"", type));
        }
      } else if (name == "data") {
        const std::string field = field_of(child.attribute("name").value());
        if (field.empty() || (field == "force" && scheme_.starts_with("serial")))
          note(child,
               "a serial scheme accelerates displacement and velocity, a parallel one the forces, too");
      } else {
        note(child, "has no counterpart");
      }
    }
  }

  void filter_limit(const pugi::xml_node& node) {
    const auto limit = number(node, "limit");
    if (!limit) return;
    constexpr double least = 1e-6, most = 0.9;
    if (*limit < least || *limit > most)
      note(node, fmt::format("a limit between {} and {} is known here: the nearest is taken", least, most));
    coupling("filter_limit", fmt::format("{}", std::clamp(*limit, least, most)));
  }

  void other(const pugi::xml_node& node) {
    const std::string family = family_of(node);
    if (family == "mesh") {
      dimension_ = std::max(dimension_, node.attribute("dimensions").as_int(0));
    } else if (family == "participant") {
      participant(node);
    } else if (family == "m2n") {
      note(node, "processes find each other through `solver` (launched here) or `connect` in their tables");
    } else if (family == "data" && kind_of(node).starts_with("global")) {
      note(node, "there is no data of a whole participant: a key in its table, or a watch of it");
    } else if (family != "coupling-scheme" && family != "data" && node.type() == pugi::node_element) {
      note(node, family == "log" ? "logs are in the run's folder, log/" : "has no counterpart");
    }
  }

  void participant(const pugi::xml_node& node) {
    const std::string role = roles_[node.attribute("name").value()];
    for (const auto& child : node.children()) {
      const std::string name = child.name();
      const std::string family = family_of(child);
      if (family == "mapping") {
        mapping(child);
      } else if (name == "watch-point") {
        watch_point(child, role);
      } else if (name == "watch-integral") {
        watches_ +=
            fmt::format("\n[[watch]]\nname = \"{}\"\nparticipant = \"coupling\"\n", watch_name(child));
      } else if (family == "export") {
        if (const auto every = child.attribute("every-n-time-windows")) frame_interval_ = every.as_int(1);
        if (kind_of(child) != "vtu" && kind_of(child) != "vtk")
          note(child, "fields are written as VTKHDF, which ParaView opens");
      } else if (name == "write-data" || name == "read-data") {
        if (field_of(child.attribute("name").value()).empty())
          note(child, fmt::format("'{}' does not travel here", child.attribute("name").value()));
      } else if (family == "action") {
        note(child, kind_of(child).ends_with("by-area")
                        ? "is not needed: the coupler makes nodal forces of a fluid's pressures itself"
                        : "has no counterpart");
      } else if (name != "provide-mesh" && name != "receive-mesh" && name != "use-mesh" &&
                 child.type() == pugi::node_element) {
        note(child, "has no counterpart");
      }
    }
  }

  void watch_point(const pugi::xml_node& node, const std::string& role) {
    std::string point = node.attribute("coordinate").value(), numbers;
    std::replace(point.begin(), point.end(), ';', ' ');
    const char* next = point.c_str();
    while (true) {
      char* end = nullptr;
      const double value = std::strtod(next, &end);
      if (end == next) break;
      numbers += fmt::format("{}{}", numbers.empty() ? "" : ", ", value);
      next = end;
    }
    if (numbers.empty()) return note(node, "has no `coordinate`");
    watches_ += fmt::format("\n[[watch]]\nname = \"{}\"\nparticipant = \"{}\"\npoint = [{}]\n",
                            watch_name(node), role, numbers);
  }

  static std::string watch_name(const pugi::xml_node& node) {
    std::string name = node.attribute("name").value();
    std::replace_if(
        name.begin(), name.end(),
        [](unsigned char c) { return std::isalnum(c) == 0 && c != '_' && c != '-'; }, '_');
    return name;
  }

  void mapping(const pugi::xml_node& node) {
    std::string kind = lower(kind_of(node));
    pugi::xml_node basis;
    for (const auto& child : node.children())
      if (family_of(child) == "basis-function") basis = child;
    // Version 2 has the function in the mapping's name, version 3 in an element of its own.
    const std::string function = basis                      ? kind_of(basis)
                                 : kind.starts_with("rbf-") ? kind.substr(4)
                                                            : std::string();
    if (kind.starts_with("rbf")) {
      if (kind.find("pum") != std::string::npos)
        note(node, "one system for all nodes is solved, not a partition of unity");
      const BasisFunction ours = basis_function(function);
      if (!ours.exact)
        note(node, fmt::format("the basis function '{}' is not known; {} is taken", function, ours.name));
      kind = ours.name;
    } else if (kind != "nearest-neighbor" && kind != "nearest-projection") {
      note(node, "no such mapping here; nearest-projection is taken");
      kind = "nearest-projection";
    }
    if (!mapping_.empty() && mapping_ != kind)
      note(node, fmt::format("one kind of mapping serves both directions; \"{}\" is kept", mapping_));
    if (mapping_.empty()) {
      mapping_ = kind;
      if (kind.starts_with("wendland"))
        if (const auto value = number(basis ? basis : node, "support-radius"))
          support_radius_ = fmt::format("{}", *value);
    }
    const std::string constraint = node.attribute("constraint").value();
    if (constraint == "conservative") loads_ = "forces";
    if (constraint.starts_with("scaled")) note(node, "is taken as consistent");
  }

  std::string scene() {
    std::string text =
        fmt::format("# From {}. What is left to do is at the end.\ntitle = {}\ndimension = {}\n\n", name_,
                    toml_string(name_), dimension_);
    if (dimension_ == 3)
      notes_.push_back(fmt::format(
          "{}: a wet surface has two dimensions here; a plane section of this case can be a scene", name_));
    text += "[coupling]\nmode = \"transient\"\n";
    if (window_ > 0) text += fmt::format("window = {:g}\n", window_);
    if (end_time_ > 0) text += fmt::format("end_time = {:g}\n", end_time_);
    for (const auto& [key, value] : coupling_) text += fmt::format("{} = {}\n", key, value);
    if (!mapping_.empty()) {
      text += fmt::format("\n[coupling.mapping]\nkind = \"{}\"\n", mapping_);
      if (!support_radius_.empty()) text += fmt::format("support_radius = {}\n", support_radius_);
      text += fmt::format("loads = \"{}\"\n", loads_);
    }
    if (scheme_ == "parallel-implicit" && !measures_.empty() && !measures_force_) {
      measures_.push_back("field = \"force\"\nmeasure = \"relative\"\nlimit = 1e-3\n");
      notes_.push_back(
          fmt::format("{}: a parallel scheme has to measure the forces, too; 1e-3 is put in", name_));
    }
    if (scheme_.ends_with("implicit"))
      for (const auto& measure : measures_) text += "\n[[coupling.convergence]]\n" + measure;
    for (const auto* role : {"fluid", "solid", "grains"}) {
      for (const auto& [name, part] : roles_)
        if (part == role)
          text += fmt::format(
              "\n[{}]\nsolver = {}   # the program to launch, or connect = \"tcp://...\"; its own keys "
              "follow\n",
              role, toml_string(lower(name)));
    }
    text += watches_;
    if (frame_interval_ > 0) text += fmt::format("\n[output]\nframe_interval = {}\n", frame_interval_);
    if (!(window_ > 0) || !(end_time_ > 0))
      notes_.push_back(fmt::format("{}: gives no `window` or no `end_time`; the scene needs both", name_));
    if (!notes_.empty()) text += "\n# Without a counterpart, or to be looked at:\n";
    for (const auto& one : notes_) text += fmt::format("#   {}\n", one);
    return text;
  }

  std::string name_;
  const std::string& text_;
  const std::map<std::string, std::string>& given_roles_;
  pugi::xml_document document_;
  pugi::xml_node root_;
  std::vector<std::string> notes_;
  std::map<std::string, std::string> roles_;
  std::set<std::string> grain_data_;
  std::map<std::string, std::string> coupling_;
  std::vector<std::string> measures_;
  bool measures_force_ = false;
  std::string scheme_, mapping_, support_radius_, loads_ = "pressures", watches_;
  int dimension_ = 2;
  int frame_interval_ = 0;
  double window_ = 0;
  double end_time_ = 0;
};

}  // namespace

PreciceImport import_precice(const std::string& name, const std::string& text,
                             const std::map<std::string, std::string>& roles) {
  return Importer(name, text, roles).run();
}

}  // namespace estuary::coupler
