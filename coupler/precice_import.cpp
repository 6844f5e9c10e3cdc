#include "precice_import.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <optional>
#include <pugixml.hpp>
#include <set>
#include <sstream>

namespace estuary::coupler {
namespace {

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

bool contains(const std::string& text, std::string_view part) {
  return text.find(part) != std::string::npos;
}

// What a field of any name is on our wet surface; empty: nothing.
std::string field_of(const std::string& data) {
  const std::string name = lower(data);
  if (contains(name, "displacement")) return "displacement";
  if (contains(name, "velocit")) return "velocity";
  if (contains(name, "force") || contains(name, "pressure") || contains(name, "stress") ||
      contains(name, "traction"))
    return "force";
  return {};
}

// The part after the colon of "coupling-scheme:serial-implicit".
std::string kind_of(const pugi::xml_node& node) {
  const std::string name = node.name();
  const std::size_t colon = name.find(':');
  return colon == std::string::npos ? std::string() : name.substr(colon + 1);
}

std::string family_of(const pugi::xml_node& node) {
  const std::string name = node.name();
  return name.substr(0, name.find(':'));
}

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
    for (const auto& child : root_.children()) {
      if (family_of(child) == "coupling-scheme") scheme(child);
    }
    if (scheme_.empty()) throw std::runtime_error(fmt::format("{}: has no coupling scheme", name_));
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

  // By what each participant writes, or else by its name.
  void find_roles() {
    std::set<std::string> taken;
    for (const auto& participant : root_.children("participant")) {
      const std::string name = participant.attribute("name").value();
      std::string role;
      if (const auto given = given_roles_.find(name); given != given_roles_.end()) role = given->second;
      for (const auto& data : participant.children("write-data")) {
        if (!role.empty()) break;
        const std::string field = field_of(data.attribute("name").value());
        if (field == "displacement" || field == "velocity") role = "solid";
        if (field == "force") role = "fluid";
      }
      const std::string word = lower(name);
      if (role.empty() && (contains(word, "solid") || contains(word, "struct"))) role = "solid";
      if (role.empty() && contains(word, "fluid")) role = "fluid";
      if (role.empty() && (contains(word, "grain") || contains(word, "particle"))) role = "grains";
      if (role.empty() || !taken.insert(role).second) {
        throw std::runtime_error(fmt::format(
            "{}:{}: cannot tell which part '{}' plays{}; say so with --role {}=fluid, solid or grains", name_,
            line_at(participant.offset_debug()), name,
            role.empty() ? std::string() : fmt::format(": another participant is the {} already", role),
            name));
      }
      roles_[name] = role;
    }
    if (roles_.size() < 2 || roles_.size() > 3)
      throw std::runtime_error(
          fmt::format("{}: has {} participants; a scene has two or three", name_, roles_.size()));
  }

  void scheme(const pugi::xml_node& node) {
    const std::string kind = kind_of(node);
    if (!scheme_.empty()) {
      note(node, "a scene has one coupling scheme for all its participants; that of the first is kept");
      return;
    }
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
    for (const auto& child : node.children()) {
      const std::string name = child.name();
      const auto value = child.attribute("value");
      if (name == "time-window-size") {
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
        acceleration(child);
      } else {
        note(child, "has no counterpart");
      }
    }
    if (windows && !(end_time_ > 0)) end_time_ = *windows * window_;
    if (!node.find_child([](const auto& child) { return family_of(child) == "acceleration"; }) &&
        scheme_.ends_with("implicit"))
      coupling("acceleration", "\"none\"");
  }

  void exchange(const pugi::xml_node& node) {
    const std::string data = node.attribute("data").value();
    const std::string field = field_of(data);
    const std::string from = roles_[node.attribute("from").value()];
    if (field.empty()) {
      note(node,
           fmt::format(
               "'{}' does not travel here: a solid gives displacements and velocities, a fluid pressures "
               "and tractions",
               data));
    } else if ((field == "force") == (from == "solid")) {
      note(node, fmt::format("'{}' goes from the {} the other way here", data, from));
    }
    if (contains(lower(data), "delta"))
      note(node, fmt::format("'{}' are increments; here displacements are those since the start", data));
    if (node.attribute("substeps").as_bool())
      note(node,
           "values inside a window do not travel; a participant interpolates between the windows' ends");
  }

  void measure(const pugi::xml_node& node) {
    const std::string name = node.name();
    const std::string field = field_of(node.attribute("data").value());
    const std::string kind = name.substr(0, name.size() - std::string_view("-convergence-measure").size());
    if (field.empty()) {
      note(node, fmt::format("'{}' is no field of the wet surface", node.attribute("data").value()));
      return;
    }
    if (kind != "relative" && kind != "absolute" && kind != "residual-relative") {
      note(node, "has no counterpart");
      return;
    }
    for (const auto* attribute : {"suffices", "strict"})
      if (node.attribute(attribute).as_bool())
        note(node, fmt::format("`{}` has no counterpart: all measures must hold", attribute));
    const auto limit = node.attribute("limit");
    measures_.push_back(
        fmt::format("field = \"{}\"\nmeasure = \"{}\"\nlimit = {}\n", field, kind, limit.value()));
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
      const std::string value = child.attribute("value").value();
      if (name == "relaxation" || name == "initial-relaxation") {
        coupling("relaxation", value);
      } else if (name == "max-used-iterations") {
        coupling("max_used_iterations", value);
      } else if (name == "time-windows-reused" || name == "timesteps-reused") {
        coupling("time_windows_reused", value);
      } else if (name == "filter") {
        const std::string type = lower(child.attribute("type").value());
        coupling("filter", fmt::format("\"{}\"", type.substr(0, 3)));
        if (type.size() > 3) note(child, fmt::format("'{}' is taken as '{}'", type, type.substr(0, 3)));
        if (const auto limit = child.attribute("limit")) coupling("filter_limit", limit.value());
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

  void other(const pugi::xml_node& node) {
    const std::string family = family_of(node);
    if (family == "mesh") {
      dimension_ = std::max(dimension_, node.attribute("dimensions").as_int(0));
    } else if (family == "participant") {
      participant(node);
    } else if (family == "m2n") {
      note(node, "processes find each other through `solver` (launched here) or `connect` in their tables");
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
        std::string point = child.attribute("coordinate").value();
        std::replace(point.begin(), point.end(), ';', ',');
        watches_ += fmt::format("\n[[watch]]\nname = \"{}\"\nparticipant = \"{}\"\npoint = [{}]\n",
                                watch_name(child), role, point);
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
      } else if (name != "provide-mesh" && name != "receive-mesh" && name != "use-mesh" &&
                 child.type() == pugi::node_element) {
        note(child, "has no counterpart");
      }
    }
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
    std::string radius;
    pugi::xml_node basis;
    for (const auto& child : node.children())
      if (family_of(child) == "basis-function") basis = child;
    // Version 2 has the function in the mapping's name, version 3 in an element of its own.
    const std::string function = basis                      ? kind_of(basis)
                                 : kind.starts_with("rbf-") ? kind.substr(4)
                                                            : std::string();
    radius = (basis ? basis : node).attribute("support-radius").value();
    if (kind.starts_with("rbf")) {
      if (contains(kind, "pum")) note(node, "one system for all nodes is solved, not a partition of unity");
      if (function == "thin-plate-splines") {
        kind = "thin-plate-spline";
      } else if (function == "compact-polynomial-c2" || function == "compact-polynomial-c4") {
        kind = "wendland-" + function.substr(function.size() - 2);
      } else {
        note(node,
             fmt::format("the basis function '{}' is not known; nearest-projection is taken", function));
        kind = "nearest-projection";
      }
    } else if (kind != "nearest-neighbor" && kind != "nearest-projection") {
      note(node, "no such mapping here; nearest-projection is taken");
      kind = "nearest-projection";
    }
    if (!mapping_.empty() && mapping_ != kind)
      note(node, fmt::format("one kind of mapping serves both directions; \"{}\" is kept", mapping_));
    if (mapping_.empty()) {
      mapping_ = kind;
      support_radius_ = kind.starts_with("wendland") ? radius : std::string();
    }
    const std::string constraint = node.attribute("constraint").value();
    if (constraint == "conservative") loads_ = "forces";
    if (constraint.starts_with("scaled")) note(node, "is taken as consistent");
  }

  std::string scene() {
    std::string text =
        fmt::format("# From {}. What is left to do is at the end.\ntitle = \"{}\"\ndimension = {}\n\n", name_,
                    name_, dimension_);
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
              "\n[{}]\nsolver = \"{}\"   # the program to launch, or connect = \"tcp://...\"; its own keys "
              "follow\n",
              role, lower(name));
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
