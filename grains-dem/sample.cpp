#include "sample.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <numbers>
#include <stdexcept>

namespace estuary::grains {
namespace {

// splitmix64 (Steele, Lea & Flood 2014): the same numbers everywhere, which the standard's distributions do
// not promise.
class Random {
public:
  explicit Random(std::int64_t seed) : state_(static_cast<std::uint64_t>(seed) * 0x9E3779B97F4A7C15ULL + 1) {}
  std::uint64_t bits() {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ULL);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }
  double unit() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  double normal() {
    const double u = std::max(unit(), 1e-300), v = unit();
    return std::sqrt(-2 * std::log(u)) * std::cos(2 * std::numbers::pi * v);
  }

private:
  std::uint64_t state_;
};

// Density of the number of grains over d_r in [0, 1], not normalised.
double number_density(const Grading& grading, double x, int dimension) {
  double density = 1;
  if (grading.law == Grading::Law::beta)
    density = std::pow(x, grading.a - 1) * std::pow(1 - x, grading.b - 1);
  if (grading.by_volume) {
    const double radius = grading.minimum + x * (grading.maximum - grading.minimum);
    density /= std::pow(radius, dimension);
  }
  return density;
}

}  // namespace

std::vector<double> draw_radii(const Grading& grading, std::size_t count, std::int64_t seed, int dimension) {
  std::vector<double> radii(count, grading.minimum);
  if (grading.law == Grading::Law::single || grading.minimum == grading.maximum) return radii;
  constexpr std::size_t kCells = 20000;
  std::vector<double> cumulative(kCells + 1, 0.0);
  for (std::size_t k = 0; k < kCells; ++k)
    cumulative[k + 1] =
        cumulative[k] + number_density(grading, (static_cast<double>(k) + 0.5) / kCells, dimension);
  for (std::size_t i = 0; i < count; ++i) {
    const double wanted = (static_cast<double>(i) + 0.5) / static_cast<double>(count) * cumulative[kCells];
    const auto above = std::lower_bound(cumulative.begin() + 1, cumulative.end(), wanted);
    const auto k = static_cast<std::size_t>(above - cumulative.begin());
    const double x =
        (static_cast<double>(k) - 1 + (wanted - cumulative[k - 1]) / (cumulative[k] - cumulative[k - 1])) /
        kCells;
    radii[i] = grading.minimum + x * (grading.maximum - grading.minimum);
  }
  Random random(seed);
  for (std::size_t i = count; i-- > 1;) std::swap(radii[i], radii[random.bits() % (i + 1)]);
  return radii;
}

template <int D>
GroupGrains<D> place_group(const GroupScene& group) {
  constexpr auto d = static_cast<std::size_t>(D);
  GroupGrains<D> grains;
  Random random(group.seed + 1000003);
  switch (group.kind) {
    case GroupScene::Kind::positions:
      grains.position = group.positions;
      grains.radius = !group.radii.empty()
                          ? group.radii
                          : draw_radii(group.grading, group.positions.size() / d, group.seed, D);
      break;
    case GroupScene::Kind::lattice: {
      const double p = group.pitch;
      const std::int64_t layers = D == 3 ? group.counts[2] : 1;
      for (std::int64_t l = 0; l < layers; ++l)
        for (std::int64_t r = 0; r < group.counts[1]; ++r)
          for (std::int64_t c = 0; c < group.counts[0]; ++c) {
            const auto column = static_cast<double>(c), row = static_cast<double>(r),
                       layer = static_cast<double>(l);
            // Rows (and layers) of a triangular lattice lie in the gaps of the one below.
            const double shift = group.triangular ? 0.5 * static_cast<double>((r + l) % 2) : 0.0;
            Vector<D> x{};
            x[0] = p * (column + shift);
            x[1] = p * row * (group.triangular ? std::sqrt(0.75) : 1.0);
            if constexpr (D == 3) {
              if (group.triangular) x[1] += p * std::sqrt(1.0 / 12) * static_cast<double>(l % 2);
              x[2] = p * layer * (group.triangular ? std::sqrt(2.0 / 3) : 1.0);
            }
            for (std::size_t axis = 0; axis < d; ++axis)
              x[axis] = group.from[axis] + group.stretch[axis] * x[axis];
            grains.position.insert(grains.position.end(), x.begin(), x.end());
          }
      grains.radius = draw_radii(group.grading, grains.position.size() / d, group.seed, D);
      break;
    }
    case GroupScene::Kind::spread: {
      // A dilute regular array, shaken within its cells.
      const auto count = static_cast<std::size_t>(group.count);
      grains.radius = draw_radii(group.grading, count, group.seed, D);
      const double largest = *std::max_element(grains.radius.begin(), grains.radius.end());
      double volume = 1;
      for (std::size_t c = 0; c < d; ++c) volume *= group.to[c] - group.from[c];
      double pitch = std::pow(volume / static_cast<double>(count), 1.0 / D);
      std::array<std::size_t, d> cells{};
      // Whole cells in every direction, with room for all grains.
      for (;; pitch *= 0.995) {
        std::size_t room = 1;
        for (std::size_t c = 0; c < d; ++c) {
          cells[c] =
              std::max<std::size_t>(1, static_cast<std::size_t>((group.to[c] - group.from[c]) / pitch));
          room *= cells[c];
        }
        if (room >= count) break;
      }
      double slack = 1e300;
      for (std::size_t c = 0; c < d; ++c)
        slack = std::min(slack, (group.to[c] - group.from[c]) / static_cast<double>(cells[c]) - 2 * largest);
      if (slack < 0)
        throw std::invalid_argument(
            fmt::format("{} grains of radius {:.3g} m do not fit into the box on a regular "
                        "array: make the box larger",
                        count, largest));
      for (std::size_t i = 0; i < count; ++i) {
        std::size_t rest = i;
        for (std::size_t c = 0; c < d; ++c) {
          const double cell = (group.to[c] - group.from[c]) / static_cast<double>(cells[c]);
          const auto at = static_cast<double>(rest % cells[c]);
          rest /= cells[c];
          grains.position.push_back(group.from[c] + cell * (at + 0.5) + 0.9 * slack * (random.unit() - 0.5));
        }
      }
      break;
    }
    case GroupScene::Kind::file:
      read_sample(group.file, D, grains.position, grains.radius);
      break;
  }
  const std::size_t n = grains.radius.size();
  constexpr std::size_t s = spin_components<D>;
  for (std::size_t i = 0; i < n; ++i) {
    grains.velocity.insert(grains.velocity.end(), group.velocity.begin(), group.velocity.end());
    grains.spin.insert(grains.spin.end(), group.spin.begin(), group.spin.begin() + s);
  }
  if (group.random_velocity > 0) {
    // No mean, and exactly the given root mean square per component.
    Vector<D> mean{};
    std::vector<double> extra(d * n);
    for (std::size_t k = 0; k < d * n; ++k) {
      extra[k] = random.normal();
      mean[k % d] += extra[k] / static_cast<double>(n);
    }
    double squares = 0;
    for (std::size_t k = 0; k < d * n; ++k) {
      extra[k] -= mean[k % d];
      squares += extra[k] * extra[k];
    }
    const double scale = n > 1 ? group.random_velocity / std::sqrt(squares / static_cast<double>(d * n)) : 0;
    for (std::size_t k = 0; k < d * n; ++k) grains.velocity[k] += scale * extra[k];
  }
  return grains;
}

std::size_t count_grains(const GroupScene& group, int dimension) {
  switch (group.kind) {
    case GroupScene::Kind::positions:
      return group.positions.size() / static_cast<std::size_t>(dimension);
    case GroupScene::Kind::lattice: {
      std::size_t product = 1;
      for (const auto n : group.counts) product *= static_cast<std::size_t>(n);
      return product;
    }
    case GroupScene::Kind::spread:
      return static_cast<std::size_t>(group.count);
    case GroupScene::Kind::file:
      break;
  }
  std::vector<double> position, radius;
  read_sample(group.file, dimension, position, radius);
  return radius.size();
}

void write_sample(const std::filesystem::path& file, int dimension, std::span<const double> position,
                  std::span<const double> radius) {
  std::ofstream out(file);
  out << (dimension == 2 ? "x,y,radius\n" : "x,y,z,radius\n");
  const auto d = static_cast<std::size_t>(dimension);
  for (std::size_t i = 0; i < radius.size(); ++i) {
    for (std::size_t c = 0; c < d; ++c) out << fmt::format("{:.17g},", position[d * i + c]);
    out << fmt::format("{:.17g}\n", radius[i]);
  }
  out.close();
  if (!out) throw std::runtime_error("cannot write " + file.string());
}

void read_sample(const std::filesystem::path& file, int dimension, std::vector<double>& position,
                 std::vector<double>& radius) {
  std::ifstream in(file);
  if (!in) throw std::invalid_argument("cannot read the sample file '" + file.string() + "'");
  std::string line;
  std::size_t number = 0;
  const auto columns = static_cast<std::size_t>(dimension) + 1;
  while (std::getline(in, line)) {
    ++number;
    if (number == 1 || line.empty()) continue;
    std::vector<double> values;
    const char* at = line.data();
    const char* const end = at + line.size();
    while (at < end) {
      double value = 0;
      const auto [next, error] = std::from_chars(at, end, value);
      if (error != std::errc() || !std::isfinite(value)) break;
      values.push_back(value);
      at = next;
      if (at < end && *at == ',')
        ++at;
      else
        break;
    }
    if (values.size() != columns || !(values.back() > 0))
      throw std::invalid_argument(
          fmt::format("{}:{}: a line holds {} finite numbers, {} and a positive radius", file.string(),
                      number, columns, dimension == 2 ? "x,y" : "x,y,z"));
    position.insert(position.end(), values.begin(), values.end() - 1);
    radius.push_back(values.back());
  }
  if (radius.empty()) throw std::invalid_argument("the sample file '" + file.string() + "' holds no grain");
}

template GroupGrains<2> place_group<2>(const GroupScene&);
template GroupGrains<3> place_group<3>(const GroupScene&);

}  // namespace estuary::grains
