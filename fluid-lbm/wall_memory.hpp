// What the pair of populations of a link was before the last collision, which wall rules that work with one
// node need and which storage in place does not keep.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "populations.hpp"

namespace estuary::fluid {

class WallMemory {
public:
  /// Forgets the links but not what they held, which goes to the same links when they are added again.
  void clear();
  /// The pair along i and its opposite at `node`; gives its number. What is not this process's `own` is only
  /// counted.
  std::size_t add(std::ptrdiff_t node, int i, const Populations& layout, bool own = true);
  /// After the last `add`.
  void finish();
  [[nodiscard]] bool empty() const { return links_.empty(); }

  /// Change of the even and the odd part of the pair by the last collision, from what leaves the node now,
  /// and the mean over time of `force` less the odd change, with `rate` (per step) as the weight of the
  /// newest; zero where the link is new. `parity` is the kind of the step that did it. May be asked again.
  struct Change {
    double even = 0;
    double odd = 0;
    double mean_excess = 0;
  };
  [[nodiscard]] Change change(std::size_t number, const Populations& populations, Parity parity, double force,
                              double rate) {
    const Link& link = links_[number];
    // Steps alternate, so that the values before a step are those noted at the other parity.
    const std::size_t k = parity == Parity::even ? 0 : 1;
    const Values& before = values_[number][1 - k];
    if (!before.known) return {};
    const double along = populations[link.leaving[k]] - before.along;
    const double against = populations[link.leaving_back[k]] - before.against;
    const double odd = 0.5 * (along - against);
    double& mean = values_[number][k].mean_excess;
    mean = before.mean_excess + rate * (force - odd - before.mean_excess);
    return {0.5 * (along + against), odd, mean};
  }
  /// Notes what the pairs are before the next collision, after all rules. Every thread of a parallel region
  /// calls it. May be done again.
  void note(const Populations& populations, Parity parity);

  /// For checkpoints; `restore` takes what it knows about the present links.
  [[nodiscard]] std::vector<double> save() const;
  void restore(const std::vector<double>& saved);

private:
  struct Values {
    double along = 0;
    double against = 0;
    double mean_excess = 0;
    bool known = false;
  };
  struct Link {
    std::int64_t key = 0;                   // 0 when it is another process's
    std::array<std::ptrdiff_t, 2> leaving;  // after an even [0] and an odd [1] step
    std::array<std::ptrdiff_t, 2> leaving_back;
    std::array<std::ptrdiff_t, 2> incoming;
    std::array<std::ptrdiff_t, 2> incoming_back;
  };
  struct Kept {
    std::int64_t key = 0;
    std::array<Values, 2> values;
  };
  void give_back(std::vector<Kept> kept);

  std::vector<Link> links_;
  std::vector<std::array<Values, 2>> values_;
  std::vector<Kept> kept_;
};

}  // namespace estuary::fluid
