// The partitioned coupling: brings fluid and solid into agreement at the wet surface, window by window.
//
//   for each window
//     x = predicted displacement of the wet surface
//     repeat
//       loads   = fluid(x)              pressures and tractions at the wet nodes
//       forces  = consistent nodal forces of the loads
//       H(x)    = solid(forces)         displacement
//       stop when |H(x) - x| < tolerance |H(x)|   (L2 over the wet nodes; in transient mode of the velocity,
//       too) x       = acceleration(x, H(x) - x)
//
// Grains are coupled explicitly, once per window (the scheme of Cook, Noble & Williams 2004 and of most
// DEM-LBM codes; the window is usually one fluid step): the fluid moves round the grains as they are, its
// forces then move the grains through the same window in as many steps as their contacts need.
//
// In transient mode an iteration goes back to the window's start and x holds displacement and velocity at its
// end; in steady mode each solver finds its equilibrium and there is one window.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "acceleration.hpp"
#include "coupling_scene.hpp"
#include "participants.hpp"
#include "progress_bar.hpp"
#include "run_record.hpp"

namespace estuary::coupler {

class CouplingLoop {
public:
  CouplingLoop(const CouplingScene& scene, Participants& participants, RunRecord& record, ProgressBar& bar);

  /// Throws RunFailure when it cannot be carried to the end.
  void run();

  [[nodiscard]] std::uint64_t total_iterations() const { return total_iterations_; }

private:
  // The wet surface's motion at the end of a window, nodes x dimension each.
  struct Motion {
    std::vector<double> displacement;
    std::vector<double> velocity;
  };
  enum class Verdict { go_on, converged, diverged };

  void start();
  void compute_alone(RemoteParticipant& participant);
  void compute_coupled();
  void compute_with_grains();
  Verdict iterate(Motion& motion, IterationRow& row);
  v1::Advanced advance(RemoteParticipant& participant, v1::Exchange inputs);
  [[nodiscard]] Motion predict() const;
  void relax(Motion& motion, const Motion& answer, IterationRow& row);
  void accept();
  void finish_window(const char* verdict, double residual, double wall_s);
  void write_frames(double time);
  void frames_if_due(std::uint64_t count, double time);
  void record_watches(const v1::Advanced& advanced, double time);
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
  v1::WetSurface surface_;
  Motion accepted_;               // at the start of the window
  std::vector<double> forces_;    // of the last iteration
  v1::GrainStates grain_states_;  // at the start of the window
  v1::Advanced last_fluid_;       // for the watches, which are recorded once accepted
  v1::Advanced last_solid_;
  Position position_;
  std::uint64_t total_iterations_ = 0;
  std::uint64_t frame_ = 0;
  double first_residual_norm_ = 0;
  double largest_velocity_norm_ = 0;  // of all accepted windows
};

}  // namespace estuary::coupler
