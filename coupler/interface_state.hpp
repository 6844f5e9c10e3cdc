// What the participants tell each other at the wet surface, as the unknown of the coupling iteration.
#pragma once

#include <vector>

#include "acceleration.hpp"
#include "coupling_scene.hpp"
#include "wet_motion.hpp"

namespace estuary::coupler {

struct InterfaceState {
  WetMotion motion;
  std::vector<double> forces;  // nodes x dimension [N, N/m in 2D]
};

/// What an accepted window leaves for the prediction of the next.
struct InterfaceHistory {
  InterfaceState accepted;               // at the start of the window
  std::vector<double> earlier_velocity;  // at the start of the window before; empty when there was none
  double earlier_duration = 0;           // of the window before [s]
};

/// Where the surface will be after `duration` [s] if it goes on as it moves, and the forces as they are:
/// none: as it is; linear: d + v t; quadratic: the velocity goes on changing as in the window before.
InterfaceState predict(Predictor predictor, const InterfaceHistory& history, double duration);

/// Room to work in, worth keeping from one iteration to the next.
struct AccelerationVectors {
  std::vector<double> iterate, residual;
};

/// Replaces `x` by the next iterate, given the answer H(x); what is torn stays as it was at the window's
/// start, so that an iteration never meets a surface that opens and closes. The fields are accelerated as one
/// vector, the velocity as the displacement it makes in one window, so that both take part with the same unit
/// and the same factor. `moves`: with the velocity; `with_forces`: with the nodal forces (parallel schemes).
/// Throws std::logic_error when lengths differ.
void accelerate(Acceleration& acceleration, InterfaceState& x, const InterfaceState& answer, double duration,
                bool moves, bool with_forces, AccelerationVectors& vectors);

}  // namespace estuary::coupler
