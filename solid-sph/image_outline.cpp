#include "image_outline.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace estuary::solid {
namespace {

using Point = std::array<double, 2>;

// Values at the centres of pixels, above 0 where solid, with a rim of void; rows from the bottom.
class Samples {
public:
  Samples(const GreyImage& image, const ImageMap& map)
      : columns(static_cast<std::size_t>(image.width) + 2),
        rows(static_cast<std::size_t>(image.height) + 2),
        map_(map),
        value_(columns * rows, -128.0) {
    for (int row = 0; row < image.height; ++row)
      for (int column = 0; column < image.width; ++column) {
        const int from_row = map.flip_y ? row : image.height - 1 - row;
        const int from_column = map.flip_x ? image.width - 1 - column : column;
        const double grey =
            image.values[static_cast<std::size_t>(from_row) * static_cast<std::size_t>(image.width) +
                         static_cast<std::size_t>(from_column)];
        // Never exactly on the threshold.
        const double above = grey - map.threshold == 0 ? 1e-6 : grey - map.threshold;
        value_[(static_cast<std::size_t>(row) + 1) * columns + static_cast<std::size_t>(column) + 1] =
            map.dark ? -above : above;
      }
  }
  [[nodiscard]] double at(std::size_t i, std::size_t j) const { return value_[j * columns + i]; }
  [[nodiscard]] Point place(double i, double j) const {
    return {map_.corner[0] + (i - 0.5) * map_.pixel, map_.corner[1] + (j - 0.5) * map_.pixel};
  }
  std::size_t columns, rows;

private:
  const ImageMap& map_;
  std::vector<double> value_;
};

constexpr std::size_t kNone = ~std::size_t{0};

// Crossings of the grid's edges, numbered 2 (j columns + i), plus 1 for the upright edge; `next` along the
// contour with the solid on the left.
class Crossings {
public:
  explicit Crossings(const Samples& samples)
      : samples_(samples), next_(2 * samples.columns * samples.rows, kNone) {
    for (std::size_t j = 0; j + 1 < samples.rows; ++j)
      for (std::size_t i = 0; i + 1 < samples.columns; ++i) link(i, j);
  }
  std::vector<Polygon> loops() {
    std::vector<Polygon> result;
    for (std::size_t start = 0; start < next_.size(); ++start) {
      if (next_[start] == kNone) continue;
      Polygon loop;
      for (std::size_t edge = start; next_[edge] != kNone;) {
        loop.push_back(point_on(edge));
        edge = std::exchange(next_[edge], kNone);
      }
      result.push_back(std::move(loop));
    }
    return result;
  }

private:
  void link(std::size_t i, std::size_t j) {
    const std::array<double, 4> corner{samples_.at(i, j), samples_.at(i + 1, j), samples_.at(i + 1, j + 1),
                                       samples_.at(i, j + 1)};
    const std::size_t below = 2 * (j * samples_.columns + i), above = below + 2 * samples_.columns;
    const std::array<std::size_t, 4> side{below, below + 3, above, below + 1};
    // Counter-clockwise round the cell, sides where the walk leaves the solid and where it enters it again.
    std::array<std::size_t, 2> leaves{}, enters{};
    std::size_t count = 0, entered = 0;
    for (std::size_t s = 0; s < 4; ++s) {
      const bool from = corner[s] > 0, to = corner[(s + 1) % 4] > 0;
      if (from && !to) leaves[count++] = s;
      if (!from && to) enters[entered++] = s;
    }
    if (count == 0) return;
    if (count == 1) {
      next_[side[leaves[0]]] = side[enters[0]];
      return;
    }
    // A saddle: joined through the middle when that is solid.
    const bool joined = corner[0] + corner[1] + corner[2] + corner[3] > 0;
    for (const std::size_t leave : leaves) {
      const std::size_t wanted = (leave + (joined ? 1 : 3)) % 4;
      next_[side[leave]] = side[wanted];
    }
  }
  [[nodiscard]] Point point_on(std::size_t edge) const {
    const std::size_t i = edge / 2 % samples_.columns, j = edge / 2 / samples_.columns;
    const bool upright = edge % 2 == 1;
    const double a = samples_.at(i, j), b = upright ? samples_.at(i, j + 1) : samples_.at(i + 1, j);
    const double t = a / (a - b);
    return samples_.place(static_cast<double>(i) + (upright ? 0 : t),
                          static_cast<double>(j) + (upright ? t : 0));
  }

  const Samples& samples_;
  std::vector<std::size_t> next_;
};

Polygon evened(const Polygon& loop, double spacing, double window) {
  const std::size_t n = loop.size();
  std::vector<double> arc(n + 1, 0.0);
  std::vector<Point> integral(n + 1, Point{});
  for (std::size_t k = 0; k < n; ++k) {
    const Point &a = loop[k], &b = loop[(k + 1) % n];
    const double l = std::hypot(b[0] - a[0], b[1] - a[1]);
    arc[k + 1] = arc[k] + l;
    for (std::size_t c = 0; c < 2; ++c) integral[k + 1][c] = integral[k][c] + 0.5 * l * (a[c] + b[c]);
  }
  const double total = arc.back();
  // Integral of the position from 0 to s along the contour, which repeats.
  const auto up_to = [&](double s) {
    const double turns = std::floor(s / total), rest = s - turns * total;
    const auto k = static_cast<std::size_t>(
        std::clamp<std::ptrdiff_t>(std::upper_bound(arc.begin(), arc.end(), rest) - arc.begin() - 1, 0,
                                   static_cast<std::ptrdiff_t>(n) - 1));
    const double l = arc[k + 1] - arc[k], part = rest - arc[k];
    Point sum{};
    for (std::size_t c = 0; c < 2; ++c) {
      const double a = loop[k][c], b = loop[(k + 1) % n][c];
      sum[c] =
          turns * integral[n][c] + integral[k][c] + (l > 0 ? part * (a + 0.5 * part / l * (b - a)) : 0.0);
    }
    return sum;
  };
  const auto count = static_cast<std::size_t>(std::max(6.0, std::round(total / spacing)));
  const double width = std::min(window, 0.25 * total);
  Polygon result;
  result.reserve(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double s = total * static_cast<double>(k) / static_cast<double>(count);
    const Point from = up_to(s - 0.5 * width), to = up_to(s + 0.5 * width);
    result.push_back({(to[0] - from[0]) / width, (to[1] - from[1]) / width});
  }
  return result;
}

}  // namespace

std::vector<std::vector<Polygon>> outlines_in_image(const GreyImage& image, const ImageMap& map,
                                                    double spacing, double smallest_area) {
  const Samples samples(image, map);
  std::vector<Polygon> outer, holes;
  for (const Polygon& loop : Crossings(samples).loops()) {
    if (std::abs(signed_area(loop)) < smallest_area) continue;
    Polygon even = evened(loop, spacing, std::max(spacing, 2 * map.pixel));
    (signed_area(loop) > 0 ? outer : holes).push_back(std::move(even));
  }
  std::stable_sort(outer.begin(), outer.end(),
                   [](const Polygon& a, const Polygon& b) { return signed_area(a) > signed_area(b); });
  std::vector<std::vector<Polygon>> result;
  result.reserve(outer.size());
  for (Polygon& loop : outer) result.push_back({std::move(loop)});
  for (Polygon& hole : holes) {
    // Of the regions round it, the smallest is its own.
    for (auto region = result.rbegin(); region != result.rend(); ++region)
      if (contains({region->front()}, hole.front()[0], hole.front()[1])) {
        region->push_back(std::move(hole));
        break;
      }
  }
  return result;
}

}  // namespace estuary::solid
