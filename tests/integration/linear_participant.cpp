// A participant with an exact answer, for tests of the coupler: it plays "fluid" or "solid".
//
//   fluid  pressure at each wet node = pressure - slope * (displacement . normal), uniform normal (0, 1)
//   solid  displacement of each wet node = nodal force / (stiffness * share), along y
//
// Coupled, displacement y of every node is -pressure / (stiffness - slope): the fixed point is known, and
// slope / stiffness is the factor by which the un-relaxed iteration contracts or diverges. A scene can also
// ask for a pressure that jumps by `jump` where the displacement is below `jump_below`, for one that swings
// by `swing` from window to window, or for a participant that misbehaves.
#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <thread>

#include "checkpoint.hpp"
#include "field_file.hpp"
#include "serve.hpp"
#include "wet_surface.hpp"

namespace {

using namespace estuary;

constexpr std::uint64_t surface_identity = 77;

class LinearParticipant final : public Participant {
public:
  Identity identity() const override {
    return {"linear-participant",
            "1",
            {"fluid", "solid"},
            {"steady", "transient", "wet-surface", "rewind", "checkpoint"},
            {2}};
  }

  Plan configure(Scene& scene, const std::string& role) override {
    role_ = role;
    SceneTable table = scene.root().table(role);
    table.leave_to_others({"solver", "connect", "threads"});
    if (role == "fluid") {
      pressure_ = table.number("pressure");
      slope_ = table.number("slope");
      jump_ = table.number_or("jump", 0.0);
      jump_below_ = table.number_or("jump_below", 0.0);
      swing_ = table.number_or("swing", 0.0);
    } else {
      stiffness_ = table.number("stiffness", Range::positive());
      nodes_ = static_cast<int>(table.integer_or("nodes", 5, 2, 1'000'000));
      largest_displacement_ = table.number_or("largest_displacement", 1e300, Range::positive());
    }
    seconds_ = table.number_or("seconds", 0.0, Range::not_negative());
    dwell_ = table.text_or("dwell", "");
    dwell_mark_ = table.text_or("dwell_mark", "");
    constexpr std::array<std::string_view, 11> kinds = {
        "none",     "nan",  "crash", "exception", "wrong-length",   "hang",
        "infinite", "huge", "zero",  "nothing",   "another-surface"};
    misbehaviour_ = table.choice("misbehaviour", kinds);
    at_window_ = static_cast<std::uint64_t>(table.integer_or("at_window", 1, 1, 1'000'000));
    at_iteration_ = static_cast<std::uint64_t>(table.integer_or("at_iteration", 1, 1, 1'000'000));
    table.refuse_unknown_keys();
    // The first time it is asked, its table is only checked.
    if (dwell_ == "configure" && !std::filesystem::exists(dwell_mark_ + ".checked")) {
      std::ofstream(dwell_mark_ + ".checked") << "checked";
    } else {
      dwell("configure");
    }
    Plan plan;
    plan.derived.emplace_back("stiffness", fmt::format("{} N/m", stiffness_));
    plan.variant = "linear";
    return plan;
  }

  v1::Exchange start(const v1::Exchange& initial, const std::filesystem::path& folder) override {
    folder_ = folder;
    dwell("start");
    v1::Exchange brought;
    if (role_ == "solid") {
      surface_.set_identity(surface_identity);
      surface_.set_dimension(2);
      for (int i = 0; i < nodes_; ++i) {
        // Walked towards +x, so the fluid lies above and its pressure pushes down.
        surface_.add_reference_positions(static_cast<double>(i) / (nodes_ - 1));
        surface_.add_reference_positions(0.0);
        if (i > 0) {
          surface_.add_connectivity(static_cast<std::uint32_t>(i - 1));
          surface_.add_connectivity(static_cast<std::uint32_t>(i));
        }
      }
      *brought.mutable_wet_surface() = surface_;
      *brought.mutable_displacements() =
          motion(std::vector<double>(2 * static_cast<std::size_t>(nodes_), 0.0));
    } else if (initial.has_wet_surface()) {
      surface_ = initial.wet_surface();
      check_wet_surface(surface_);
    }
    return brought;
  }

  AdvanceResult advance(const Window& window, const v1::Exchange& inputs, ProgressBoard& progress) override {
    const bool now = window.number == at_window_ && window.iteration == at_iteration_;
    if (now) dwell("advance");
    if (now && misbehaviour_ == "crash") std::raise(SIGKILL);
    if (now && misbehaviour_ == "exception")
      throw Diverged("velocity", "speed 12 at cell (3, 4)", "a smaller time step");
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds_);
    while (std::chrono::steady_clock::now() < end || (now && misbehaviour_ == "hang")) {
      if (misbehaviour_ != "hang") progress.report(0.5);
      if (progress.stop_requested()) throw Interrupted();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    AdvanceResult result;
    ++result.work.steps;
    if (role_ == "fluid") {
      check_displacements(inputs.displacements(), surface_);
      auto& pressures = *result.outputs.mutable_pressures();
      pressures.set_surface(surface_.identity());
      for (int i = 1; i < inputs.displacements().displacement_size(); i += 2) {
        const double displacement = inputs.displacements().displacement(i);
        pressures.add_pressure(pressure_ - slope_ * displacement + (displacement < jump_below_ ? jump_ : 0) +
                               (window.number % 2 == 0 ? swing_ : -swing_));
      }
      if (now && misbehaviour_ == "nan") pressures.set_pressure(1, std::numeric_limits<double>::quiet_NaN());
      if (now && misbehaviour_ == "wrong-length") pressures.add_pressure(0.0);
      if (now) misbehave(*pressures.mutable_pressure());
      if (now && misbehaviour_ == "another-surface") {  // a mesh that was made anew, with a node more
        pressures.set_surface(surface_identity + 1);
        pressures.add_pressure(pressure_);
      }
      if (now && misbehaviour_ == "nothing") result.outputs.Clear();
    } else {
      check_forces(inputs.forces(), surface_);
      std::vector<double> displacement(static_cast<std::size_t>(inputs.forces().force_size()), 0.0);
      const double share = 1.0 / (nodes_ - 1);
      for (std::size_t i = 1; i < displacement.size(); i += 2) {
        const bool end_node = i == 1 || i + 1 == displacement.size();
        displacement[i] =
            inputs.forces().force(static_cast<int>(i)) / (stiffness_ * share * (end_node ? 0.5 : 1.0));
      }
      if (std::abs(displacement[1]) > largest_displacement_)
        throw NotConverged("no equilibrium under this load", "a smaller load");
      if (now && misbehaviour_ == "nan") displacement[3] = std::numeric_limits<double>::quiet_NaN();
      if (now && misbehaviour_ == "wrong-length") displacement.push_back(0.0);
      auto& displacements = *result.outputs.mutable_displacements();
      displacements = motion(displacement);
      if (now) misbehave(*displacements.mutable_displacement());
      if (now && misbehaviour_ == "another-surface") {
        displacement.resize(displacement.size() + 2);
        displacements = motion(displacement);
        displacements.set_surface(surface_identity + 1);
      }
      if (now && misbehaviour_ == "nothing") result.outputs.Clear();
      result.watches.push_back({"tip", {{"displacement", std::abs(displacement[1])}}});
    }
    return result;
  }

  void accept() override { dwell("accept"); }
  // It has no state: its answers belong to the window's inputs alone.
  void save(const std::filesystem::path& file) override {
    dwell("save");
    CheckpointWriter(file).commit();
  }
  void load(const std::filesystem::path& file) override {
    dwell("load");
    const CheckpointReader reader(file);
  }
  void stop() override { dwell("stop"); }

  std::vector<std::string> frame(std::uint64_t number, double /*time*/) override {
    dwell("frame");
    const std::string name = fmt::format("{}-{:06}.hdf", role_, number);
    const std::vector<double> positions(surface_.reference_positions().begin(),
                                        surface_.reference_positions().end());
    write_points(folder_ / name, 2, positions, {}, {});
    return {name};
  }

private:
  // The first time it comes to `phase` it says so and stays there for long, for somebody to disturb it.
  void dwell(const std::string& phase) const {
    if (dwell_ != phase || std::filesystem::exists(dwell_mark_)) return;
    std::ofstream(dwell_mark_) << phase;
    std::this_thread::sleep_for(std::chrono::seconds(20));
  }
  template <typename Values>
  void misbehave(Values& values) const {
    if (misbehaviour_ == "infinite") values.Set(1, std::numeric_limits<double>::infinity());
    for (double& value : values) {
      if (misbehaviour_ == "huge") value = 1e300;
      if (misbehaviour_ == "zero") value = 0;
    }
  }
  static v1::Displacements motion(const std::vector<double>& displacement) {
    v1::Displacements message;
    message.set_surface(surface_identity);
    message.mutable_displacement()->Assign(displacement.begin(), displacement.end());
    message.mutable_velocity()->Resize(static_cast<int>(displacement.size()), 0.0);
    return message;
  }

  std::string role_;
  std::string misbehaviour_;
  std::string dwell_;
  std::string dwell_mark_;
  std::filesystem::path folder_;
  v1::WetSurface surface_;
  double pressure_ = 0;
  double slope_ = 0;
  double jump_ = 0;
  double jump_below_ = 0;
  double swing_ = 0;
  double stiffness_ = 1;
  double largest_displacement_ = 0;
  double seconds_ = 0;
  int nodes_ = 5;
  std::uint64_t at_window_ = 1;
  std::uint64_t at_iteration_ = 1;
};

}  // namespace

int main(int argc, char** argv) {
  return estuary::serve(argc, argv, std::make_unique<LinearParticipant>());
}
