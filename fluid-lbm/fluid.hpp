// The lattice Boltzmann fluid as a participant of a run.
#pragma once

#include <chrono>
#include <memory>
#include <optional>

#include "body_motion.hpp"
#include "fluid_scene.hpp"
#include "grain_coupling.hpp"
#include "output.hpp"
#include "participant.hpp"
#include "steady.hpp"
#include "wet_load.hpp"

namespace estuary::fluid {

class Fluid : public Participant {
public:
  Fluid() = default;
  /// One of several processes that share the lattice and carry out the same calls (ranks.hpp). What depends
  /// on the clock or on what the coupler says is the first one's; it alone writes and reads files.
  explicit Fluid(Ranks& ranks) : ranks_(&ranks) {}
  [[nodiscard]] Identity identity() const override;
  Plan configure(Scene& scene, const std::string& role) override;
  v1::Exchange start(const v1::Exchange& initial, const std::filesystem::path& folder) override;
  AdvanceResult advance(const Window& window, const v1::Exchange& inputs, ProgressBoard& progress) override;
  [[nodiscard]] std::optional<double> window_step() const override { return scene_.units.time_step; }
  void accept() override;
  void save(const std::filesystem::path& file) override;
  void load(const std::filesystem::path& file) override;
  std::vector<std::string> frame(std::uint64_t number, double time) override;

private:
  // Displacement and velocity of all wet nodes [m, m/s].
  struct Motion {
    std::vector<double> displacement;
    std::vector<double> velocity;
  };
  void take_surface(const v1::Exchange& initial);
  [[nodiscard]] Motion motion_of(const v1::Exchange& inputs) const;
  void move_surface(const Motion& motion);
  void move_inside_window(const Motion& end, double fraction, double duration);
  void give_back(const Flow::State& state);
  // Obstacles at a time and grains at a fraction of the window.
  void place_bodies(double time, double fraction, bool fill);
  void restart_body_loads();
  [[nodiscard]] GrainLoads grain_loads() const;
  void set_initial_fields();
  void set_time(double time);

  void advance_transient(const Window& window, const Motion& end, ProgressBoard& progress);
  double advance_steady(const Window& window, const Motion& end, ProgressBoard& progress);
  void run(std::size_t steps);
  void evaluate_fields();
  // Loads on the wet nodes now; completed to `exchanged_` when the scene asks for it.
  void evaluate_loads();
  // Adds the momentum exchange of the wet surface now, with a weight, to `exchanged_`.
  void add_exchanged(double weight);
  void restart_exchanged();
  double load_change();
  void check_state();
  void log_walls();
  void check_progress(ProgressBoard& progress, double fraction, const std::string& note);
  [[nodiscard]] std::size_t steps_at_once() const;
  [[nodiscard]] bool first_rank() const { return ranks_ == nullptr || ranks_->rank() == 0; }
  [[nodiscard]] std::unique_ptr<Flow> make_flow() const;
  void expect_same_pictures() const;
  AdvanceResult result();
  void check_result(const AdvanceResult& advanced);

  // Time spent, by phase [s].
  struct Seconds {
    double collide_and_stream = 0;
    double wet_surface = 0;
    double fields_and_loads = 0;
  };

  Ranks* ranks_ = nullptr;  // null: the whole lattice is this process's
  FluidScene scene_;
  std::unique_ptr<Flow> flow_;
  std::unique_ptr<Output> output_;
  v1::WetSurface surface_;
  Motion accepted_;  // at the window's start
  Motion latest_;    // at the end of the last advance
  std::optional<Flow::State> window_start_;
  GrainCoupling grains_;
  std::unique_ptr<BodyMotion> bodies_;
  double time_ = 0;  // at the window's start [s]
  double end_time_ = 0;
  WetLoad wet_load_;
  bool wet_load_stale_ = true;
  std::vector<std::vector<Node>> looked_at_;  // by watches, where ranks share the grid
  Fields fields_;
  bool fields_current_ = false;
  std::vector<double> pressure_;  // lattice units
  std::vector<double> traction_;
  // On the wet surface by momentum exchange, as far as the scene asks for it: now, or the mean over a window.
  struct Exchanged {
    Force total;
    std::vector<double> nodes;  // force on each
  };
  Exchanged exchanged_;
  NodeValues previous_x_;  // steady mode: velocities and loads at the last check
  NodeValues previous_y_;
  NodeValues previous_z_;
  std::vector<double> previous_load_;
  bool sides_constant_ = true;  // and the body force
  std::uint64_t steps_ = 0;
  std::uint64_t steps_checked_ = 0;  // when every node was looked at last
  double updates_ = 0;
  std::size_t fallbacks_logged_ = 0;
  Seconds seconds_;
};

}  // namespace estuary::fluid
