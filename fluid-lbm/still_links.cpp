#include "still_links.hpp"

#include <algorithm>

namespace estuary::fluid {

void StillLinks::clear() {
  links_.clear();
  places_.clear();
  first_of_row_.clear();
}

void StillLinks::add(Node node, int i, std::uint32_t body, const std::array<double, 3>& arm,
                     const Populations& layout) {
  const bool space = layout.nz() > 0;
  reach_ = space ? layout.ny() + 1 : 1;
  const auto layers_below = static_cast<std::size_t>(space ? node.z : 0);
  const std::size_t row =
      static_cast<std::size_t>(layout.ny()) * layers_below + static_cast<std::size_t>(node.y);
  while (first_of_row_.size() <= row) first_of_row_.push_back(links_.size());
  const std::ptrdiff_t here = layout.node(node.x, node.y, node.z);
  links_.push_back(
      {layout.post_collision(Parity::even, i, here), layout.post_collision(Parity::odd, i, here)});
  places_.push_back({body, i, arm});
}

template <class Stored>
void StillLinks::reflect(Stored* f, Parity parity, std::size_t begin, std::size_t end) const {
  if (parity == Parity::even) {
    for (std::size_t n = begin; n < end; ++n) f[links_[n].at_neighbour] = f[links_[n].at_node];
  } else {
    for (std::size_t n = begin; n < end; ++n) f[links_[n].at_node] = f[links_[n].at_neighbour];
  }
}

void StillLinks::reflect(Populations& populations, Parity parity) const {
  constexpr std::size_t piece = 1024;
  const auto pieces = static_cast<std::ptrdiff_t>((links_.size() + piece - 1) / piece);
  populations.visit([&](auto* const f) {
#pragma omp for schedule(static)
    for (std::ptrdiff_t n = 0; n < pieces; ++n) {
      const std::size_t begin = static_cast<std::size_t>(n) * piece;
      reflect(f, parity, begin, std::min(begin + piece, links_.size()));
    }
  });
}

void StillLinks::reflect_rows(Populations& populations, Parity parity, int begin, int end) const {
  const auto first = [this](int row) {
    const auto n = static_cast<std::size_t>(row);
    return n < first_of_row_.size() ? first_of_row_[n] : links_.size();
  };
  populations.visit([&](auto* const f) { reflect(f, parity, first(begin), first(end)); });
}

// A row's links write where the step of the far end's row, up to `reach_` rows on, may write back what it
// found.
void StillLinks::reflect_behind(Populations& populations, Parity parity, const RowShare& share,
                                int row) const {
  const int behind = row - 1 - reach_;
  if (behind < share.begin + reach_ || behind >= share.end - reach_) return;
  reflect_rows(populations, parity == Parity::even ? Parity::odd : Parity::even, behind, behind + 1);
}

void StillLinks::reflect_rest(Populations& populations, Parity parity, const RowShare& share) const {
  const Parity now = parity == Parity::even ? Parity::odd : Parity::even;
  const int first = std::min(share.begin + reach_, share.end);
  const int last = std::max(first, share.end - 1 - reach_);
  reflect_rows(populations, now, share.begin, first);
  reflect_rows(populations, now, last, share.end);
}

void StillLinks::add_load(const Populations& populations, Parity parity, std::size_t number,
                          BodyLoad& total) const {
  const Place& place = places_[number];
  const Link& link = links_[number];
  const auto& c = populations.lattice().velocity[place.direction];
  // What leaves and what comes back are equal.
  const double twice = 2 * populations[parity == Parity::even ? link.at_node : link.at_neighbour];
  const std::array<double, 3> f{twice * c[0], twice * c[1], twice * c[2]};
  const auto& arm = place.arm;
  total += {f, {arm[1] * f[2] - arm[2] * f[1], arm[2] * f[0] - arm[0] * f[2], arm[0] * f[1] - arm[1] * f[0]}};
}

BodyLoad StillLinks::load(const Populations& populations, Parity parity) const {
  BodyLoad total;
  in_turn(ranks_, total, [&](BodyLoad& sum) {
    for (std::size_t n = 0; n < links_.size(); ++n) add_load(populations, parity, n, sum);
  });
  return total;
}

BodyLoad StillLinks::load(const Populations& populations, Parity parity, std::uint32_t body) const {
  BodyLoad total;
  in_turn(ranks_, total, [&](BodyLoad& sum) {
    for (std::size_t n = 0; n < links_.size(); ++n) {
      if (places_[n].body == body) add_load(populations, parity, n, sum);
    }
  });
  return total;
}

}  // namespace estuary::fluid
