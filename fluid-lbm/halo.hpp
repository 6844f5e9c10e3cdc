// What the slabs of a shared lattice tell each other about the layers at their ends.
//
// With one copy of the populations (populations.hpp) a location has two owners in turn. After an even step,
// slot[k](x) is what left x: its node's. After an odd one it is what reaches x along k, put there by the node
// x - c_k. Rules then write what reaches a node: after an even step that stands at x - c_k, possibly in the
// halo, after an odd one at the node itself. Hence two transfers:
//   take_back   of a halo's layer next to the slab, the populations that point outwards or inwards across the
//               slab's end go home to the neighbour's outermost layer: what an odd step scattered, or rules
//               after an even one wrote
//   give        of the slab's outermost layers go to the neighbours' halos: the populations that cross, which
//               is all that streaming and most rules need, or everything of `Populations::halo` layers, for
//               rules that look at a node beside their own
// Where the outermost axis is periodic the two ends of the lattice are joined, with the order of events of
// the copies across periodic sides (sides.cpp).
#pragma once

#include <array>
#include <vector>

#include "populations.hpp"
#include "ranks.hpp"

namespace estuary::fluid {

class Halo {
public:
  /// `ranks` outlives it.
  Halo(Ranks& ranks, const Grid& grid);

  /// Before the rules of a step: what streaming needs, or with `everything` what rules need that look at a
  /// node beside their own (its halo comes with `give_everything`, once other periodic sides are copied).
  void exchange(Populations& populations, Parity parity, bool everything);
  void give_everything(Populations& populations) { give(populations, true, true, true); }
  /// What rules have written for the nodes on one side of a slab's end is what left those on the other.
  void tell_of_rules(Populations& populations, Parity parity);
  /// All of the neighbours' outermost layers as they are, for nodes that are filled; again after each layer
  /// of those.
  void look_around(Populations& populations, Parity parity);
  /// Brings home what belongs to the slab's own layers.
  void complete_slab(Populations& populations) {
    if (!complete_) take_back(populations, true, false);
    complete_ = true;
  }

  /// Whether the slab's own layers hold all that belongs to them. After an even step they do; after an odd
  /// one part of it lies in the neighbours' halos; rules turn it round.
  [[nodiscard]] bool complete() const { return complete_; }
  void set_complete(bool complete) { complete_ = complete; }
  void stepped(Parity parity) { complete_ = parity == Parity::even; }
  void ruled(Parity parity) { complete_ = parity == Parity::odd; }
  void filled(Parity parity) { complete_ = parity == Parity::even; }

  [[nodiscard]] Ranks& ranks() const { return ranks_; }

private:
  // With `across_period` also where the lattice's two ends are joined.
  void take_back(Populations& populations, bool between_slabs, bool across_period);
  void give(Populations& populations, bool between_slabs, bool across_period, bool everything);
  // One end of the slab.
  struct End {
    int partner = -1;  // -1: the lattice ends
    bool across_period = false;
    int towards = 0;  // of directions that leave the slab here
    int inner = 0;    // outermost layer of the slab
    int outer = 0;    // the halo's next to it
    std::vector<std::byte> outgoing;
    std::vector<std::byte> incoming;
  };
  // Which populations of which layers.
  struct Part {
    std::span<const int> populations;
    int first_layer = 0;
    int layers = 1;
  };
  [[nodiscard]] std::span<const int> crossing(int towards) const { return crossing_[towards > 0 ? 1 : 0]; }
  static void pack(Populations& populations, const Part& part, std::vector<std::byte>& bytes);
  static void unpack(Populations& populations, const Part& part, const std::vector<std::byte>& bytes);
  template <class Parts>
  void transfer(Populations& populations, bool between_slabs, bool across_period, const Parts& parts);

  Ranks& ranks_;
  std::array<std::vector<int>, 2> crossing_;  // populations whose direction has -1 or 1 along the axis
  std::vector<int> all_;
  std::array<End, 2> ends_;
  bool complete_ = false;
};

}  // namespace estuary::fluid
