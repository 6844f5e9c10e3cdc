// The grains that a partner moves through the fluid: where they are inside a window, and what they feel.
//
// Loads are means over the window's steps, so that impulse is conserved whatever the partner's steps are. In
// partially saturated cells fluid moves along inside a grain; the force that this takes is not the
// surrounding fluid's and is taken out: + rho_f V dv/dt, and for the torque rho_f I dw/dt (in the manner of
// Feng, Michaelides, Comput. Fluids 38 (2009)).
#pragma once

#include <functional>
#include <span>

#include "checkpoint.hpp"
#include "grain_states.hpp"
#include "participant.hpp"

namespace estuary::fluid {

class GrainCoupling {
public:
  /// Takes the grains that `initial` brings; without any nothing here does anything.
  void start(const v1::Exchange& initial, const Grid& grid, const Units& units);
  [[nodiscard]] bool active() const { return active_; }
  /// The grains at the end of the window to come. Throws BadInput, and Diverged when one moves faster than
  /// the lattice bears. In steady mode grains are held where they are.
  void take(const v1::Exchange& inputs, double duration, bool steady);
  /// No grain moves or turns in this window.
  [[nodiscard]] bool resting() const;
  /// Where they are when a step begins, a fraction of the window after its start, with the velocity that
  /// they have in the middle of the step, lattice units: what links at their walls work with.
  [[nodiscard]] Grains in_step(double fraction) const;
  /// One time step later: what the collision of a step that begins there works with, so that the fluid feels
  /// a window's last velocity in that window already.
  [[nodiscard]] Grains after_step(double fraction) const;
  /// `loads` are means over the window, lattice units; `filled`: fluid moves along inside the grains.
  void write(const GrainLoads& loads, bool filled, v1::Exchange& outputs) const;
  void accept() { start_ = end_; }
  void save(CheckpointWriter& writer) const;
  /// `read(name, values)` fills the values with what was saved under the name.
  void load(const std::function<void(const char*, std::span<double>)>& read);

private:
  // A grain that crosses a periodic side comes back at the other one: its image that is nearest to where it
  // was is taken, else it would move back through the whole of the fluid inside the window. Its place is
  // counted on from window to window, so that a window begins where the last one ended, to the bit.
  void go_on_across_periodic_sides();
  [[nodiscard]] double later(double fraction, double steps) const;

  bool active_ = false;
  Grid grid_;
  Units units_;
  Grains start_;  // SI
  Grains end_;
  double duration_ = 0;
};

}  // namespace estuary::fluid
