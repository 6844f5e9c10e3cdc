#include "still_links.hpp"

#include <algorithm>

namespace estuary::fluid {

void StillLinks::clear() {
  links_.clear();
  apart_.clear();
  places_.clear();
}

void StillLinks::add(Node node, int i, std::uint32_t body, const std::array<double, 3>& arm,
                     const Populations& layout) {
  const std::ptrdiff_t here = layout.node(node.x, node.y, node.z);
  const Link link{layout.post_collision(Parity::even, i, here), layout.post_collision(Parity::odd, i, here)};
  links_.push_back(link);
  if (layout.packed() && link.at_node != link.at_neighbour) apart_.push_back(link);
  places_.push_back({body, i, arm});
}

void StillLinks::reflect(Populations& populations, Parity parity) const {
  constexpr std::size_t piece = 1024;
  const std::vector<Link>& links = populations.packed() ? apart_ : links_;
  const auto pieces = static_cast<std::ptrdiff_t>((links.size() + piece - 1) / piece);
  populations.visit([&](auto* const f) {
#pragma omp for schedule(static)
    for (std::ptrdiff_t n = 0; n < pieces; ++n) {
      const std::size_t begin = static_cast<std::size_t>(n) * piece;
      const std::size_t end = std::min(begin + piece, links.size());
      if (parity == Parity::even) {
        for (std::size_t k = begin; k < end; ++k) f[links[k].at_neighbour] = f[links[k].at_node];
      } else {
        for (std::size_t k = begin; k < end; ++k) f[links[k].at_node] = f[links[k].at_neighbour];
      }
    }
  });
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
