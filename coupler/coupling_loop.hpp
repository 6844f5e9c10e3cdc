// The partitioned coupling: brings fluid, grains and solid into agreement, window by window.
//
//   for each window
//     x = predicted motion of the wet surface (parallel schemes: and the forces on it)
//     repeat
//       serial                                      parallel, all at once
//         loads  = fluid(x, grains)                   loads  = fluid(x, grains)
//         forces = nodal forces of the loads          grains = grains(x, last forces on grains)
//         grains = grains(x, forces on grains)        H(x)   = solid(forces of x)
//         H(x)   = solid(forces)                      forces = nodal forces of the loads
//       stop when H(x) and x agree (convergence.hpp)
//       x = acceleration(x, H(x) - x)
//
// In transient mode an iteration goes back to the window's start and x holds displacement and velocity at its
// end; in steady mode each solver finds its equilibrium and there is one window. Explicit schemes do the body
// once. What a scene has no participant for is left out of the body.
//
// The fluid always flows round the grains as they are at the window's start (with the velocities they have
// then), and its forces move them through the window in as many steps as their contacts need: the scheme of
// Cook, Noble & Williams (2004) and of most DEM-LBM codes. The window is then usually one fluid step.
//
// When an iteration diverges or stalls, or a participant finds no solution, the window is tried again with
// care before the run is given up (`Care`).
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "acceleration.hpp"
#include "convergence.hpp"
#include "coupling_scene.hpp"
#include "failure.hpp"
#include "participants.hpp"
#include "progress_bar.hpp"
#include "run_record.hpp"
#include "wet_motion.hpp"

namespace estuary::coupler {

class CouplingLoop {
public:
  CouplingLoop(const CouplingScene& scene, Participants& participants, RunRecord& record, ProgressBar& bar);

  /// Throws RunFailure when it cannot be carried to the end.
  void run();

  [[nodiscard]] std::uint64_t total_iterations() const { return total_iterations_; }
  /// How often a window had to be tried again with more care.
  [[nodiscard]] std::uint64_t recoveries() const { return recoveries_; }

private:
  // What the participants tell each other at the wet surface.
  struct Interface {
    WetMotion motion;
    std::vector<double> forces;  // nodes x dimension [N, N/m in 2D]
  };
  // How carefully a window is iterated.
  enum class Care { normal, without_history, small_steps };

  void start();
  void start_solid(v1::Exchange& for_others);
  void compute_window();
  void compute_alone(RemoteParticipant& participant);
  bool more_care(const RunFailure& failure);
  // Iterates until a verdict other than go_on; false when the iterations allowed were used up.
  bool iterate_window(Interface& x);
  void iterate(Interface& x);
  Interface answer_in_turn(const Interface& x, IterationRow& row);
  Interface answer_at_once(const Interface& x, IterationRow& row);
  double ask_solid(const std::vector<double>& forces);
  v1::Exchange for_fluid(const WetMotion& motion) const;
  v1::Exchange for_grains(const WetMotion& motion) const;
  v1::Exchange for_solid(const std::vector<double>& forces) const;
  // Sum of what fluid and grains exert on the wet nodes.
  std::vector<double> nodal_forces(const WetMotion& motion) const;
  void describe(const Interface& x, const Interface& answer, IterationRow& row) const;
  [[nodiscard]] Interface predict() const;
  void accelerate(Interface& x, const Interface& answer);
  void accept_window(const char* verdict, double wall_s);

  v1::Request advance_request(v1::Exchange inputs) const;
  v1::Advanced advance(RemoteParticipant& participant, v1::Exchange inputs);
  v1::Advanced advanced_of(const RemoteParticipant& participant, v1::Reply reply) const;
  void accept();
  void finish_window(const char* verdict, double residual, double wall_s);
  void write_frames(double time);
  void frames_if_due(std::uint64_t count, double time);
  void record_watches(const v1::Advanced& advanced, double time);
  void record_all_watches();
  [[nodiscard]] double window_start() const;
  [[nodiscard]] double window_end() const;

  const CouplingScene& scene_;
  Participants& participants_;
  RunRecord& record_;
  ProgressBar& bar_;
  RemoteParticipant* fluid_;
  RemoteParticipant* solid_;
  RemoteParticipant* grains_;
  std::unique_ptr<Acceleration> acceleration_;
  std::unique_ptr<Convergence> convergence_;  // once the surface is known
  v1::WetSurface surface_;
  Interface accepted_;                    // at the start of the window
  std::vector<double> earlier_velocity_;  // at the start of the window before
  v1::GrainStates grain_states_;          // at the start of the window
  std::vector<double> last_forces_;       // of the last iteration
  IterationNorms norms_;                  // of the last iteration
  v1::Advanced last_fluid_;               // for the watches, which are recorded once accepted
  v1::Advanced last_grains_;
  v1::Advanced last_solid_;
  Verdict verdict_ = Verdict::go_on;  // of the last iteration
  Position position_;
  Care care_ = Care::normal;
  std::uint64_t total_iterations_ = 0;
  std::uint64_t recoveries_ = 0;
  std::uint64_t frame_ = 0;
};

}  // namespace estuary::coupler
