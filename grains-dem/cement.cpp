#include "cement.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>
#include <stdexcept>

namespace estuary::grains {
namespace {

constexpr std::uint32_t kPore = 0xffffffff;

// Which voxel of the box is solid, and by which grain.
template <int D>
class Voxels {
public:
  Voxels(const CementScene& scene, const Domain<D>& domain, double edge) : edge_(edge) {
    std::size_t total = 1;
    for (std::size_t c = 0; c < axes; ++c) {
      from_[c] = scene.from[c];
      const double length = scene.to[c] - scene.from[c];
      count_[c] = std::max<std::int64_t>(1, std::llround(length / edge));
      period_[c] = domain.periodic[c] && std::abs(length - domain.length(c)) < 0.5 * edge ? count_[c] : 0;
      total *= static_cast<std::size_t>(count_[c]);
    }
    owner_.assign(total, kPore);
  }

  /// Gives the pore voxels with their centre in a ball to `owner`; gives back how many there were.
  std::size_t fill_ball(const Vector<D>& x, double r, std::uint32_t owner) {
    std::array<std::int64_t, 3> low{}, high{};
    for (std::size_t c = 0; c < axes; ++c) {
      low[c] = static_cast<std::int64_t>(std::ceil((x[c] - r - from_[c]) / edge_ - 0.5));
      high[c] = static_cast<std::int64_t>(std::floor((x[c] + r - from_[c]) / edge_ - 0.5));
    }
    std::size_t filled = 0;
    std::array<std::int64_t, 3> at{};
    for (at[2] = low[2]; at[2] <= high[2]; ++at[2])
      for (at[1] = low[1]; at[1] <= high[1]; ++at[1])
        for (at[0] = low[0]; at[0] <= high[0]; ++at[0]) {
          double squared = 0;
          for (std::size_t c = 0; c < axes; ++c) {
            const double apart = from_[c] + (static_cast<double>(at[c]) + 0.5) * edge_ - x[c];
            squared += apart * apart;
          }
          std::size_t place = 0;
          if (squared >= r * r || !find(at, place) || owner_[place] != kPore) continue;
          owner_[place] = owner;
          ++filled;
        }
    return filled;
  }

  [[nodiscard]] std::size_t size() const { return owner_.size(); }
  [[nodiscard]] std::uint32_t owner(std::size_t place) const { return owner_[place]; }
  void give(std::size_t place, std::uint32_t owner) { owner_[place] = owner; }

  [[nodiscard]] Vector<D> centre(std::size_t place) const {
    Vector<D> x{};
    for (std::size_t c = 0; c < axes; ++c) {
      const auto count = static_cast<std::size_t>(count_[c]);
      x[c] = from_[c] + (static_cast<double>(place % count) + 0.5) * edge_;
      place /= count;
    }
    return x;
  }

  /// Calls `visit` with each voxel that shares a face with this one.
  template <class Visit>
  void for_neighbours(std::size_t place, const Visit& visit) const {
    std::array<std::int64_t, 3> at{};
    std::size_t rest = place;
    for (std::size_t c = 0; c < axes; ++c) {
      at[c] = static_cast<std::int64_t>(rest % static_cast<std::size_t>(count_[c]));
      rest /= static_cast<std::size_t>(count_[c]);
    }
    for (std::size_t c = 0; c < axes; ++c)
      for (const std::int64_t step : {-1, 1}) {
        std::array<std::int64_t, 3> other = at;
        other[c] += step;
        std::size_t found = 0;
        if (find(other, found)) visit(found);
      }
  }

private:
  static constexpr std::size_t axes = D;

  // False outside of the box.
  bool find(std::array<std::int64_t, 3> at, std::size_t& place) const {
    place = 0;
    for (std::size_t c = axes; c-- > 0;) {
      if (period_[c] > 0) at[c] = ((at[c] % period_[c]) + period_[c]) % period_[c];
      if (at[c] < 0 || at[c] >= count_[c]) return false;
      place = place * static_cast<std::size_t>(count_[c]) + static_cast<std::size_t>(at[c]);
    }
    return true;
  }

  double edge_;
  Vector<D> from_{};
  std::array<std::int64_t, 3> count_{}, period_{};
  std::vector<std::uint32_t> owner_;
};

template <int D>
void add_bridges(const CementScene& scene, const Domain<D>& domain, std::span<const double> position,
                 std::span<const double> radius, Cement<D>& cement) {
  constexpr std::size_t d = D;
  for (std::size_t i = 0; i < radius.size(); ++i)
    for (std::size_t j = i + 1; j < radius.size(); ++j) {
      const Vector<D> x = load<d>(position.data(), i);
      Vector<D> apart = load<d>(position.data(), j) - x;
      for (std::size_t c = 0; c < d; ++c)
        if (domain.periodic[c]) apart[c] -= domain.length(c) * std::round(apart[c] / domain.length(c));
      const double distance = norm(apart), sum = radius[i] + radius[j];
      if (distance - sum > scene.distance_ratio * sum) continue;
      // Between the circles in which the cone meets the two grains.
      const double end_i = scene.diameter_ratio * radius[i], end_j = scene.diameter_ratio * radius[j];
      const double first = std::sqrt(radius[i] * radius[i] - end_i * end_i);
      const double last = distance - std::sqrt(radius[j] * radius[j] - end_j * end_j);
      if (last <= first) continue;
      const auto parts = static_cast<int>(std::ceil((last - first) / (0.5 * std::min(end_i, end_j))));
      for (int k = 0; k <= parts; ++k) {
        const double share = static_cast<double>(k) / parts;
        Vector<D> centre = x + ((first + share * (last - first)) / distance) * apart;
        for (std::size_t c = 0; c < d; ++c)
          if (domain.periodic[c])
            centre[c] -= domain.length(c) * std::floor((centre[c] - domain.from[c]) / domain.length(c));
        cement.centre.insert(cement.centre.end(), centre.begin(), centre.end());
        cement.radius.push_back(end_i + share * (end_j - end_i));
        cement.owner.push_back(static_cast<std::uint32_t>(share < 0.5 ? i : j));
      }
    }
}

template <int D>
std::size_t accrete(const CementScene& scene, std::size_t pores, Voxels<D>& voxels, Cement<D>& cement) {
  std::mt19937_64 random(static_cast<std::uint64_t>(scene.seed));
  const auto wanted = static_cast<std::size_t>(std::llround(scene.saturation * static_cast<double>(pores)));
  // Pore voxels with a solid neighbour; each at most once.
  std::vector<std::size_t> open;
  std::vector<bool> listed(voxels.size(), false);
  const auto list = [&](std::size_t place) {
    if (voxels.owner(place) != kPore || listed[place]) return;
    listed[place] = true;
    open.push_back(place);
  };
  for (std::size_t place = 0; place < voxels.size(); ++place)
    if (voxels.owner(place) != kPore) voxels.for_neighbours(place, list);
  // The radius of a ball (disc) of the voxel's volume.
  const double body =
      scene.voxel * (D == 3 ? std::cbrt(0.75 / std::numbers::pi) : std::sqrt(1 / std::numbers::pi));
  std::size_t filled = 0;
  for (; filled < wanted; ++filled) {
    if (open.empty())
      throw std::invalid_argument(
          fmt::format("random cement fills only {:.3g} of the pores: the others touch nothing",
                      static_cast<double>(filled) / static_cast<double>(pores)));
    const std::size_t chosen = static_cast<std::size_t>(random() % open.size());
    const std::size_t place = open[chosen];
    open[chosen] = open.back();
    open.pop_back();
    std::uint32_t owner = kPore;
    voxels.for_neighbours(place, [&](std::size_t other) { owner = std::min(owner, voxels.owner(other)); });
    voxels.give(place, owner);
    voxels.for_neighbours(place, list);
    const Vector<D> centre = voxels.centre(place);
    cement.centre.insert(cement.centre.end(), centre.begin(), centre.end());
    cement.radius.push_back(body);
    cement.owner.push_back(owner);
  }
  return filled;
}

}  // namespace

template <int D>
Cement<D> make_cement(const CementScene& scene, const Domain<D>& domain, std::span<const double> position,
                      std::span<const double> radius) {
  Cement<D> cement;
  if (scene.model == CementScene::Model::none) return cement;
  // Bridges and coatings are thinner than a voxel of the fluid: measured in finer ones.
  const bool random = scene.model == CementScene::Model::random;
  Voxels<D> voxels(scene, domain, random ? scene.voxel : scene.voxel / 3);
  std::size_t solid = 0;
  for (std::size_t i = 0; i < radius.size(); ++i)
    solid += voxels.fill_ball(load<D>(position.data(), i), radius[i], static_cast<std::uint32_t>(i));
  const std::size_t pores = voxels.size() - solid;
  if (pores == 0) throw std::invalid_argument("there are no pores in the box of the cement");
  std::size_t filled = 0;
  switch (scene.model) {
    case CementScene::Model::bridges:
      add_bridges(scene, domain, position, radius, cement);
      for (std::size_t b = 0; b < cement.bodies(); ++b)
        filled += voxels.fill_ball(load<D>(cement.centre.data(), b), cement.radius[b], cement.owner[b]);
      break;
    case CementScene::Model::coating:
      cement.coating = scene.thickness_ratio * std::accumulate(radius.begin(), radius.end(), 0.0) /
                       static_cast<double>(radius.size());
      for (std::size_t i = 0; i < radius.size(); ++i)
        filled += voxels.fill_ball(load<D>(position.data(), i), radius[i] + cement.coating,
                                   static_cast<std::uint32_t>(i));
      break;
    case CementScene::Model::random:
      filled = accrete(scene, pores, voxels, cement);
      break;
    case CementScene::Model::none:
      break;
  }
  cement.saturation = static_cast<double>(filled) / static_cast<double>(pores);
  cement.porosity = static_cast<double>(pores - filled) / static_cast<double>(voxels.size());
  return cement;
}

template Cement<2> make_cement(const CementScene&, const Domain<2>&, std::span<const double>,
                               std::span<const double>);
template Cement<3> make_cement(const CementScene&, const Domain<3>&, std::span<const double>,
                               std::span<const double>);

}  // namespace estuary::grains
