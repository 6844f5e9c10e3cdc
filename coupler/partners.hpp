// One pass through the participants: from a state of the wet surface to their answer to it. Makes the
// messages, checks what comes back and turns loads into nodal forces; decides nothing about the iteration.
//
//   serial                                      parallel, all at once
//     loads  = fluid(x, grains)                   loads  = fluid(x, grains)
//     forces = nodal forces of the loads          grains = grains(x, last forces on grains)
//     grains = grains(x, forces on grains)        H(x)   = solid(forces of x)
//     H(x)   = solid(forces)                      forces = nodal forces of the loads
//
// The fluid always flows round the grains as they are at the window's start (with the velocities they have
// then), and its forces move them through the window in as many steps as their contacts need: the scheme of
// Cook, Noble & Williams (2004) and of most DEM-LBM codes. The window is then usually one fluid step.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "coupling_scene.hpp"
#include "interface_state.hpp"
#include "participants.hpp"
#include "run_record.hpp"
#include "surface_link.hpp"

namespace estuary::coupler {

/// The stretch of time that is computed [s].
struct WindowSpan {
  double begin = 0;
  double duration = 0;
};

class Partners {
public:
  Partners(const CouplingScene& scene, Participants& participants);

  /// Starts everyone: the solid brings the wet surface and the grains their states, so they start first; the
  /// fluid starts around both. Throws RunFailure. Afterwards `initial` holds the state of the wet surface.
  void start();
  [[nodiscard]] const InterfaceState& initial() const { return initial_; }
  [[nodiscard]] const v1::WetSurface& surface() const { return surface_; }
  /// True when there is a wet surface whose motion has to be agreed on.
  [[nodiscard]] bool agree() const { return solid_.there() && participants_.all().size() > 1; }

  /// True when a window is computed once, and accepted as it comes out.
  [[nodiscard]] bool once() const { return !scene_.implicit() || !agree(); }

  /// The participants' answer to `x`, in turn or at once as the scheme says. In steady mode a load that is
  /// too much for the solid is given in part; `row` carries times, sums and the part given.
  InterfaceState answer(const InterfaceState& x, const WindowSpan& span, const Position& position,
                        IterationRow& row);
  /// The only participant computes its window.
  void advance_alone(const WindowSpan& span, const Position& position);
  /// The last answers become the start of the next window.
  void accept(const Position& position);
  void write_frames(std::uint64_t number, double time, const Position& position);

  /// Calls `use` with the last answer of each participant that has answered.
  template <typename Use>
  void for_each_answer(const Use& use) const {
    for (const Partner* partner : {&fluid_, &grains_, &solid_})
      if (partner->there()) use(partner->last);
  }
  /// Any length of a window that all allow is a multiple of this [s]; 0: any length. Throws RunFailure naming
  /// who computes windows of the scene's length only.
  [[nodiscard]] double window_granularity() const;
  /// How often a load was halved because the solid could not take it.
  [[nodiscard]] std::uint64_t halvings() const { return halvings_; }

  /// What the next window starts from, between two windows: the states of the grains and the last answers, as
  /// serialised messages by name. `load` throws std::runtime_error when they cannot be read.
  [[nodiscard]] std::map<std::string, std::string> save() const;
  void load(const std::map<std::string, std::string>& messages);

private:
  // A participant with what it said of itself at the start.
  struct Partner {
    RemoteParticipant* participant;          // null: the scene has none
    std::optional<double> window_step = {};  // granularity of its windows [s]
    std::optional<SurfaceLink> link = {};    // when it brought a wet surface of its own
    v1::Advanced last = {};                  // its last answer
    [[nodiscard]] bool there() const { return participant != nullptr; }
  };
  v1::Exchange ask_start(Partner& partner, v1::Exchange initial);
  void link_surface(Partner& partner, const v1::Exchange& brought);
  void take_surface(v1::Exchange& for_others);
  InterfaceState answer_in_turn(const InterfaceState& x, IterationRow& row);
  InterfaceState answer_at_once(const InterfaceState& x, IterationRow& row);
  double ask_solid(const std::vector<double>& forces);
  v1::Request advance_request(const RemoteParticipant& participant, v1::Exchange inputs) const;
  void advance(Partner& partner, v1::Exchange inputs);
  v1::Advanced advanced_of(const RemoteParticipant& participant, v1::Reply reply) const;
  v1::Exchange for_fluid(const WetMotion& motion) const;
  v1::Exchange for_grains(const WetMotion& motion) const;
  v1::Displacements motion_for(const Partner& partner, const WetMotion& motion) const;
  v1::Exchange for_solid(const std::vector<double>& forces) const;
  // Sum of what fluid and grains exert on the wet nodes.
  std::vector<double> nodal_forces(const WetMotion& motion, IterationRow& row) const;
  void describe(const InterfaceState& x, const InterfaceState& answer, IterationRow& row) const;

  const CouplingScene& scene_;
  Participants& participants_;
  Partner fluid_;
  Partner solid_;
  Partner grains_;
  v1::WetSurface surface_;
  InterfaceState initial_;
  v1::GrainStates grain_states_;  // at the start of the window
  WindowSpan span_;               // of the pass under way
  Position position_;
  std::uint64_t halvings_ = 0;
};

}  // namespace estuary::coupler
