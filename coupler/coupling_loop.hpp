// The partitioned coupling: brings fluid, grains and solid into agreement, window by window.
//
//   for each window
//     x = predicted motion of the wet surface (parallel schemes: and the forces on it)
//     repeat
//       H(x) = answer of the participants (partners.hpp)
//       stop when H(x) and x agree (convergence.hpp)
//       x = acceleration(x, H(x) - x)
//
// In transient mode an iteration goes back to the window's start and x holds displacement and velocity at its
// end; in steady mode each solver finds its equilibrium and there is one window. Explicit schemes do the body
// once. What a scene has no participant for is left out of the body.
//
// When an iteration diverges or stalls, or a participant finds no solution, the window is tried again with
// care before the run is given up (`Care`), and then, where they allow it, with half the length.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

#include "acceleration.hpp"
#include "checkpoints.hpp"
#include "convergence.hpp"
#include "coupling_scene.hpp"
#include "failure.hpp"
#include "participants.hpp"
#include "partners.hpp"
#include "progress_bar.hpp"
#include "run_record.hpp"
#include "window_clock.hpp"
#include "window_swing.hpp"

namespace estuary::coupler {

class CouplingLoop {
public:
  /// `begun`: when the run began, had it gone on all the time.
  CouplingLoop(const CouplingScene& scene, Participants& participants, RunRecord& record, ProgressBar& bar,
               Checkpoints& checkpoints, std::chrono::steady_clock::time_point begun);

  /// Starts everyone. Throws RunFailure.
  void start();
  /// After `start`: everyone goes back to a checkpoint, and the tables with them. Throws std::runtime_error
  /// when the set cannot be used after all.
  void go_to(const CheckpointSet& set);
  /// Throws RunFailure when it cannot be carried to the end.
  void run();

  [[nodiscard]] std::uint64_t total_iterations() const { return total_iterations_; }

private:
  // How carefully a window is iterated.
  enum class Care { normal, without_history, small_steps };

  void keep_if_due();
  bool keep();
  [[nodiscard]] CouplerState state() const;
  void compute_window();
  void compute_alone();
  // Tries a failed window again? With more care, then with half the length.
  bool try_again(const RunFailure& failure);
  void take_care(Care care);
  // Iterates until a verdict other than go_on; false when the iterations allowed were used up.
  bool iterate_window(InterfaceState& x);
  void iterate(InterfaceState& x);
  void judge(const InterfaceState& x, const InterfaceState& answer, IterationRow& row);
  void look_for_crossing();
  // What is known of why the window failed, to add to what the user is told; may ask the participants
  // `answer_calls` times more.
  [[nodiscard]] RunFailure explained(const RunFailure& failure, InterfaceState x, bool settles);
  void accept_window(const char* verdict, double wall_s);
  void finish_window(const char* verdict, double residual, double wall_s);
  void write_frames(double time);
  void frames_if_due(std::uint64_t count, double time);
  void record_watches(double time);
  void record(const v1::WatchSample& sample, double time);
  // The time that rows and watches of the window under way belong to; in steady mode the iteration.
  [[nodiscard]] double time_of_window() const;
  [[nodiscard]] bool steady() const { return scene_.mode == CouplingMode::steady; }
  [[nodiscard]] bool once() const { return partners_.once(); }

  const CouplingScene& scene_;
  Participants& participants_;
  RunRecord& record_;
  ProgressBar& bar_;
  Checkpoints& checkpoints_;
  std::chrono::steady_clock::time_point begun_;
  Partners partners_;
  WindowClock clock_;
  std::unique_ptr<Acceleration> acceleration_;
  AccelerationVectors acceleration_vectors_;
  std::unique_ptr<Convergence> convergence_;  // once the surface is known
  InterfaceHistory history_;
  InterfaceState last_;               // the last answer
  WindowSwing swing_;                 // of the forces, over the windows since the start or a checkpoint
  IterationNorms norms_;              // of the last iteration
  Verdict verdict_ = Verdict::go_on;  // of the last iteration
  Position position_;
  Care care_ = Care::normal;
  Care acceleration_care_ = Care::normal;  // with which the acceleration was made, in this window or before
  bool bodies_can_meet_ = false;
  bool warned_of_crossing_ = false;
  std::uint64_t total_iterations_ = 0;
  std::uint64_t frame_ = 0;
};

}  // namespace estuary::coupler
