#include "placement.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace estuary::grains {
namespace {

constexpr std::array<const char*, 3> kAxes{"x", "y", "z"};

template <int D>
void check_period(const DynamicsSettings<D>& settings, const InitialGrains<D>& grains) {
  const double largest = *std::max_element(grains.radius.begin(), grains.radius.end());
  for (std::size_t c = 0; c < static_cast<std::size_t>(D); ++c)
    if (settings.domain.periodic[c] && settings.domain.length(c) < 4 * largest + 2 * settings.skin)
      throw std::invalid_argument(fmt::format(
          "the periodic direction {} is {:g} m long, shorter than two diameters of the largest grain and "
          "the skin ({:g} m): a grain would touch another one twice",
          kAxes[c], settings.domain.length(c), 4 * largest + 2 * settings.skin));
}

template <int D>
void check_centres(const InitialGrains<D>& grains) {
  std::vector<std::size_t> order(grains.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto before = [&](std::size_t a, std::size_t b) {
    return std::lexicographical_compare(&grains.position[D * a], &grains.position[D * a] + D,
                                        &grains.position[D * b], &grains.position[D * b] + D);
  };
  std::sort(order.begin(), order.end(), before);
  for (std::size_t k = 1; k < order.size(); ++k)
    if (!before(order[k - 1], order[k]))
      throw std::invalid_argument(fmt::format("grains {} and {} have the same centre",
                                              std::min(order[k - 1], order[k]),
                                              std::max(order[k - 1], order[k])));
}

template <int D>
void check_sides(const std::vector<Wall<D>>& walls, const InitialGrains<D>& grains) {
  for (const Wall<D>& wall : walls) {
    if (!wall.is_plane()) continue;
    for (std::size_t i = 0; i < grains.size(); ++i) {
      if (grains.held[i]) continue;
      const Vector<D> x = load<D>(grains.position.data(), i);
      const double inside = dot(x - wall.point, wall.normal);
      if (!(inside < 0)) continue;
      throw std::invalid_argument(
          fmt::format("the centre of grain {} at ({:g}) lies {:g} m behind the wall '{}'", i,
                      fmt::join(x, ", "), -inside, wall.name));
    }
  }
}

}  // namespace

template <int D>
void check_placement(const DynamicsSettings<D>& settings, const std::vector<Wall<D>>& walls,
                     const InitialGrains<D>& grains) {
  check_period(settings, grains);
  check_centres(grains);
  check_sides(walls, grains);
}

template <int D>
DeepestOverlap deepest_overlap(const DynamicsSettings<D>& settings, const InitialGrains<D>& grains) {
  State<D> state;
  state.position = grains.position;
  state.radius = grains.radius;
  state.wrapped.assign(grains.position.size(), 0.0);
  for (std::size_t i = 0; i < grains.size(); ++i) {
    state.inverse_mass.push_back(grains.held[i] ? 0 : 1);
    state.identity.push_back(static_cast<std::uint32_t>(i));
  }
  std::vector<std::uint32_t> origin;
  ListSettings list;
  list.skin = settings.skin;  // cells of a size class without grains need a size too
  rebuild_list(settings.domain, list, state, origin);
  DeepestOverlap deepest;
  for (std::size_t i = 0; i < state.size(); ++i)
    for (std::size_t k = state.row_start[i]; k < state.row_start[i + 1]; ++k) {
      const std::size_t j = state.partner[k];
      const double distance = norm(load<D>(state.position.data(), j) + settings.domain.shift(state.image[k]) -
                                   load<D>(state.position.data(), i));
      const double depth =
          (state.radius[i] + state.radius[j] - distance) / std::min(state.radius[i], state.radius[j]);
      if (depth > deepest.depth) deepest = {state.identity[i], state.identity[j], depth};
    }
  return deepest;
}

template <int D>
DeepestInWall deepest_in_wall(const std::vector<Wall<D>>& walls, const InitialGrains<D>& grains) {
  DeepestInWall deepest;
  for (const Wall<D>& wall : walls) {
    if (!wall.is_plane()) continue;
    for (std::size_t i = 0; i < grains.size(); ++i) {
      if (grains.held[i]) continue;
      const double inside = dot(load<D>(grains.position.data(), i) - wall.point, wall.normal);
      const double depth = 1 - inside / grains.radius[i];
      if (depth > deepest.depth) deepest = {i, wall.name, depth};
    }
  }
  return deepest;
}

template void check_placement(const DynamicsSettings<2>&, const std::vector<Wall<2>>&,
                              const InitialGrains<2>&);
template void check_placement(const DynamicsSettings<3>&, const std::vector<Wall<3>>&,
                              const InitialGrains<3>&);
template DeepestOverlap deepest_overlap(const DynamicsSettings<2>&, const InitialGrains<2>&);
template DeepestOverlap deepest_overlap(const DynamicsSettings<3>&, const InitialGrains<3>&);
template DeepestInWall deepest_in_wall(const std::vector<Wall<2>>&, const InitialGrains<2>&);
template DeepestInWall deepest_in_wall(const std::vector<Wall<3>>&, const InitialGrains<3>&);

}  // namespace estuary::grains
