#include "nearest_facet.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

using Point = std::array<double, 3>;
constexpr std::size_t leaf_size = 8;

Point minus(const Point& a, const Point& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
double dot(const Point& a, const Point& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Share of the way from a to b of the point of the segment nearest to p; 0 for a segment without length.
double along_segment(const Point& p, const Point& a, const Point& b) {
  const Point ab = minus(b, a);
  const double square = dot(ab, ab);
  return square > 0 ? std::clamp(dot(minus(p, a), ab) / square, 0.0, 1.0) : 0.0;
}

// Weights of the corners of the point of a triangle nearest to p: inside by the barycentric coordinates of
// the projection, else on the nearest edge.
std::array<double, 3> on_triangle(const Point& p, const std::array<Point, 3>& t) {
  const Point u = minus(t[1], t[0]);
  const Point v = minus(t[2], t[0]);
  const Point w = minus(p, t[0]);
  const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), wu = dot(w, u), wv = dot(w, v);
  const double determinant = uu * vv - uv * uv;
  if (determinant > 1e-14 * uu * vv) {
    const double b = (vv * wu - uv * wv) / determinant;
    const double c = (uu * wv - uv * wu) / determinant;
    if (b >= 0 && c >= 0 && b + c <= 1) return {1 - b - c, b, c};
  }
  std::array<double, 3> best{};
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const double s = along_segment(p, t[i], t[j]);
    Point q{};
    for (std::size_t axis = 0; axis < 3; ++axis) q[axis] = (1 - s) * t[i][axis] + s * t[j][axis];
    const Point gap = minus(p, q);
    if (dot(gap, gap) >= least) continue;
    least = dot(gap, gap);
    best = {};
    best[i] = 1 - s;
    best[j] = s;
  }
  return best;
}

}  // namespace

NearestFacet::NearestFacet(const v1::WetSurface& surface, NearestTo kind)
    : surface_(surface), corners_per_item_(kind == NearestTo::nodes ? 1 : surface.dimension()) {
  if (kind == NearestTo::nodes) {
    items_.resize(node_count(surface));
    std::iota(items_.begin(), items_.end(), 0U);
  } else {
    items_.assign(surface.connectivity().begin(), surface.connectivity().end());
  }
  order_.resize(items_.size() / corners_per_item_);
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  build(0, order_.size());
}

NearestFacet::Point NearestFacet::corner(std::uint32_t node) const {
  const auto dimension = static_cast<int>(surface_.dimension());
  Point point{};
  for (int axis = 0; axis < dimension; ++axis)
    point[static_cast<std::size_t>(axis)] =
        surface_.reference_positions(static_cast<int>(node) * dimension + axis);
  return point;
}

std::span<const std::uint32_t> NearestFacet::corners(std::size_t item) const {
  return {items_.data() + item * corners_per_item_, corners_per_item_};
}

std::size_t NearestFacet::build(std::size_t first, std::size_t last) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  Box box{.low = {infinity, infinity, infinity},
          .high = {-infinity, -infinity, -infinity},
          .first = first,
          .last = last,
          .left = 0,
          .right = 0};
  for (std::size_t k = first; k < last; ++k) {
    for (const std::uint32_t node : corners(order_[k])) {
      const Point point = corner(node);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        box.low[axis] = std::min(box.low[axis], point[axis]);
        box.high[axis] = std::max(box.high[axis], point[axis]);
      }
    }
  }
  const std::size_t number = boxes_.size();
  boxes_.push_back(box);
  if (last - first <= leaf_size) return number;
  std::size_t widest = 0;
  for (std::size_t axis = 1; axis < 3; ++axis)
    if (box.high[axis] - box.low[axis] > box.high[widest] - box.low[widest]) widest = axis;
  const std::size_t middle = (first + last) / 2;
  const auto at = [&](std::size_t k) { return order_.begin() + static_cast<std::ptrdiff_t>(k); };
  std::nth_element(at(first), at(middle), at(last), [&](std::size_t a, std::size_t b) {
    const double place_a = corner(corners(a).front())[widest];
    const double place_b = corner(corners(b).front())[widest];
    return place_a != place_b ? place_a < place_b : a < b;
  });
  const std::size_t left = build(first, middle);
  const std::size_t right = build(middle, last);
  boxes_[number].left = left;
  boxes_[number].right = right;
  return number;
}

double NearestFacet::squared_distance(const Box& box, const Point& point) {
  double square = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double gap = point[axis] - std::clamp(point[axis], box.low[axis], box.high[axis]);
    square += gap * gap;
  }
  return square;
}

FacetPoint NearestFacet::nearest_on(std::size_t item, const Point& point) const {
  FacetPoint found;
  const auto nodes = corners(item);
  found.count = nodes.size();
  std::copy(nodes.begin(), nodes.end(), found.node.begin());
  std::array<Point, 3> place{};
  for (std::size_t k = 0; k < nodes.size(); ++k) place[k] = corner(nodes[k]);
  if (nodes.size() == 1) {
    found.weight = {1, 0, 0};
  } else if (nodes.size() == 2) {
    const double s = along_segment(point, place[0], place[1]);
    found.weight = {1 - s, s, 0};
  } else {
    found.weight = on_triangle(point, place);
  }
  Point gap = point;
  for (std::size_t k = 0; k < nodes.size(); ++k)
    for (std::size_t axis = 0; axis < 3; ++axis) gap[axis] -= found.weight[k] * place[k][axis];
  found.squared_distance = dot(gap, gap);
  return found;
}

FacetPoint NearestFacet::find(std::span<const double> given) const {
  Point point{};
  std::copy(given.begin(), given.end(), point.begin());
  FacetPoint best;
  best.squared_distance = std::numeric_limits<double>::infinity();
  std::size_t best_item = 0;
  std::vector<std::size_t> open{0};
  while (!open.empty()) {
    const Box& box = boxes_[open.back()];
    open.pop_back();
    if (squared_distance(box, point) > best.squared_distance) continue;
    if (box.left == 0) {
      for (std::size_t k = box.first; k < box.last; ++k) {
        const std::size_t item = order_[k];
        const FacetPoint candidate = nearest_on(item, point);
        if (candidate.squared_distance < best.squared_distance ||
            (candidate.squared_distance == best.squared_distance && item < best_item)) {
          best = candidate;
          best_item = item;
        }
      }
      continue;
    }
    // The nearer child last, so that it is looked at first.
    const bool left_nearer =
        squared_distance(boxes_[box.left], point) <= squared_distance(boxes_[box.right], point);
    open.push_back(left_nearer ? box.right : box.left);
    open.push_back(left_nearer ? box.left : box.right);
  }
  return best;
}

}  // namespace estuary::coupler
