#include "outline_filling.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "neighbourhood.hpp"

namespace estuary::solid {
namespace {

using Point = std::array<double, 2>;

Point operator-(const Point& a, const Point& b) {
  return {a[0] - b[0], a[1] - b[1]};
}
double cross(const Point& a, const Point& b) {
  return a[0] * b[1] - a[1] * b[0];
}
double length(const Point& a) {
  return std::hypot(a[0], a[1]);
}

// A contour keeps a corner where its direction turns by more than this.
constexpr double kCorner = 20.0 * std::numbers::pi / 180;

double turn(const Polygon& loop, std::size_t k) {
  const std::size_t n = loop.size();
  const Point in = loop[k] - loop[(k + n - 1) % n], out = loop[(k + 1) % n] - loop[k];
  return std::atan2(cross(in, out), in[0] * out[0] + in[1] * out[1]);
}

Polygon resampled(const Polygon& loop, double spacing) {
  const std::size_t n = loop.size();
  if (n == 0) return {};
  std::vector<std::size_t> corners;
  for (std::size_t k = 0; k < n; ++k)
    if (std::abs(turn(loop, k)) > kCorner) corners.push_back(k);
  if (corners.empty()) corners.push_back(0);
  Polygon result;
  for (std::size_t c = 0; c < corners.size(); ++c) {
    const std::size_t from = corners[c];
    std::size_t to = corners[(c + 1) % corners.size()];
    if (to <= from) to += n;
    double total = 0;
    for (std::size_t k = from; k < to; ++k) total += length(loop[(k + 1) % n] - loop[k % n]);
    const auto parts =
        static_cast<std::size_t>(std::max(corners.size() == 1 ? 3.0 : 1.0, std::round(total / spacing)));
    double walked = 0;
    std::size_t k = from;
    for (std::size_t part = 0; part < parts; ++part) {
      const double wanted = total * static_cast<double>(part) / static_cast<double>(parts);
      double segment = length(loop[(k + 1) % n] - loop[k % n]);
      while (walked + segment < wanted * (1 - 1e-12) && k + 1 < to) {
        walked += segment;
        ++k;
        segment = length(loop[(k + 1) % n] - loop[k % n]);
      }
      const double share = segment > 0 ? (wanted - walked) / segment : 0;
      const Point &a = loop[k % n], &b = loop[(k + 1) % n];
      result.push_back({a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])});
    }
  }
  return result;
}

// The part of a convex or plain polygon on the inner side of n . x <= d (Sutherland & Hodgman 1974).
void cut(Polygon& polygon, const Point& normal, double distance, Polygon& scratch) {
  scratch.clear();
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Point &a = polygon[k], &b = polygon[(k + 1) % polygon.size()];
    const double da = normal[0] * a[0] + normal[1] * a[1] - distance;
    const double db = normal[0] * b[0] + normal[1] * b[1] - distance;
    if (da <= 0) scratch.push_back(a);
    if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
      const double t = da / (da - db);
      scratch.push_back({a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])});
    }
  }
  polygon.swap(scratch);
}

struct Moments {
  double area = 0, x = 0, y = 0;
};

Moments moments(const Polygon& p) {
  Moments m;
  for (std::size_t k = 0; k < p.size(); ++k) {
    const Point &a = p[k], &b = p[(k + 1) % p.size()];
    const double w = 0.5 * cross(a, b);
    m.area += w;
    m.x += w * (a[0] + b[0]) / 3;
    m.y += w * (a[1] + b[1]) / 3;
  }
  return m;
}

double distance_to_segment(const Point& p, const Point& a, const Point& b) {
  const Point ab = b - a, ap = p - a;
  const double t = std::clamp((ap[0] * ab[0] + ap[1] * ab[1]) / (ab[0] * ab[0] + ab[1] * ab[1]), 0.0, 1.0);
  return std::hypot(ap[0] - t * ab[0], ap[1] - t * ab[1]);
}

// The cells of all particles in coordinates relative to each: convex, not yet cut by the contour.
std::vector<Polygon> cells_of(const Body& body, double reach) {
  const ReferenceSearch search(body, reach);
  std::vector<Polygon> cells(body.size());
#pragma omp parallel for schedule(static)
  for (std::size_t i = 0; i < body.size(); ++i) {
    Polygon cell{{-reach, -reach}, {reach, -reach}, {reach, reach}, {-reach, reach}}, scratch;
    for (const auto& found : search.within(body.position[2 * i], body.position[2 * i + 1], 2 * reach)) {
      const double r2 = found.x * found.x + found.y * found.y;
      if (r2 > 0) cut(cell, {found.x, found.y}, 0.5 * r2, scratch);
    }
    cells[i] = std::move(cell);
  }
  return cells;
}

}  // namespace

double signed_area(const Polygon& polygon) {
  return moments(polygon).area;
}

Polygon circle(std::array<double, 2> centre, double radius, double spacing) {
  const auto count =
      static_cast<std::size_t>(std::max(8.0, std::round(2 * std::numbers::pi * radius / spacing)));
  const double angle = 2 * std::numbers::pi / static_cast<double>(count);
  const double r = radius * std::sqrt(angle / std::sin(angle));  // the polygon then has the circle's area
  Polygon polygon;
  polygon.reserve(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double turned = static_cast<double>(k) * angle;
    polygon.push_back({centre[0] + r * std::cos(turned), centre[1] + r * std::sin(turned)});
  }
  return polygon;
}

bool contains(const std::vector<Polygon>& loops, double x, double y) {
  bool inside = false;
  for (const Polygon& loop : loops)
    for (std::size_t k = 0; k < loop.size(); ++k) {
      const Point &a = loop[k], &b = loop[(k + 1) % loop.size()];
      if ((a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1])) inside = !inside;
    }
  return inside;
}

Body place_on_contours(const std::vector<Polygon>& loops, double spacing) {
  const double d = spacing;
  Body body;
  body.spacing = {d, d};
  for (std::size_t l = 0; l < loops.size(); ++l) {
    Polygon loop = loops[l];
    const double area = signed_area(loop);
    if (loop.size() < 3 || !(std::abs(area) > 1e-3 * d * d))
      throw std::invalid_argument("an outline encloses no area");
    // Clockwise outside, counter-clockwise round holes.
    if ((area > 0) == (l == 0)) std::reverse(loop.begin(), loop.end());
    Outline outline;
    for (const Point& p : resampled(loop, d)) {
      outline.particle.push_back(static_cast<std::uint32_t>(body.position.size() / 2));
      body.position.insert(body.position.end(), {p[0], p[1]});
    }
    body.outlines.push_back(std::move(outline));
    body.outline_member.push_back(0);
  }
  const std::size_t n = body.position.size() / 2;
  body.volume.assign(n, 0.5 * d * d);
  body.energy_volume = body.volume;
  body.mass.assign(n, 0.0);
  body.member.assign(n, 0);
  body.edge.assign(n, 1);
  body.fixed.assign(n, 0);
  return body;
}

AreaMoments area_moments(const std::vector<Polygon>& loops) {
  AreaMoments sum;
  // Relative to a point of the outline: far from the origin nothing is lost.
  const Point origin = loops.front().front();
  for (std::size_t l = 0; l < loops.size(); ++l) {
    const Polygon& p = loops[l];
    const double sign = (signed_area(p) > 0) == (l == 0) ? 1 : -1;
    for (std::size_t k = 0; k < p.size(); ++k) {
      const Point a = p[k] - origin, b = p[(k + 1) % p.size()] - origin;
      const double w = sign * 0.5 * cross(a, b);
      sum.area += w;
      for (std::size_t c = 0; c < 2; ++c) {
        sum.centroid[c] += w * (a[c] + b[c]) / 3;
        sum.polar += w * (a[c] * a[c] + a[c] * b[c] + b[c] * b[c]) / 6;
      }
    }
  }
  for (double& c : sum.centroid) c /= sum.area;
  sum.polar -= sum.area * (sum.centroid[0] * sum.centroid[0] + sum.centroid[1] * sum.centroid[1]);
  for (std::size_t c = 0; c < 2; ++c) sum.centroid[c] += origin[c];
  return sum;
}

Body fill_outline(const std::vector<Polygon>& loops, const FillingOptions& options) {
  const double d = options.spacing;
  Body body = place_on_contours(loops, d);
  body.smoothing_length = options.smoothing_ratio * d;
  std::vector<Polygon> contours;
  for (const Outline& outline : body.outlines) {
    Polygon& contour = contours.emplace_back();
    for (const std::uint32_t i : outline.particle)
      contour.push_back({body.position[2 * i], body.position[2 * i + 1]});
  }
  const std::size_t on_contour = body.position.size() / 2;
  Point low{1e300, 1e300}, high{-1e300, -1e300};
  for (const Point& p : contours.front())
    for (std::size_t c = 0; c < 2; ++c) {
      low[c] = std::min(low[c], p[c]);
      high[c] = std::max(high[c], p[c]);
    }
  // Closer to the contour than this there is no room for another row.
  const double margin = 0.65 * d;
  for (Point p{low[0] + d, 0}; p[0] < high[0]; p[0] += d)
    for (p[1] = low[1] + d; p[1] < high[1]; p[1] += d) {
      if (!contains(contours, p[0], p[1])) continue;
      bool clear = true;
      for (const Polygon& loop : contours)
        for (std::size_t k = 0; clear && k < loop.size(); ++k)
          clear = distance_to_segment(p, loop[k], loop[(k + 1) % loop.size()]) > margin;
      if (clear) body.position.insert(body.position.end(), {p[0], p[1]});
    }
  const std::size_t n = body.position.size() / 2;
  body.volume.assign(n, d * d);
  body.member.assign(n, 0);
  body.edge.assign(n, 0);
  body.fixed.assign(n, 0);
  std::fill_n(body.edge.begin(), on_contour, std::uint8_t{1});
  const double reach = 2.5 * d;
  for (int step = 0; step < options.evening_steps; ++step) {
    const auto cells = cells_of(body, reach);
    for (std::size_t i = on_contour; i < n; ++i) {
      const Moments m = moments(cells[i]);
      body.position[2 * i] += m.x / m.area;
      body.position[2 * i + 1] += m.y / m.area;
    }
  }
  const auto cells = cells_of(body, reach);
  for (std::size_t i = on_contour; i < n; ++i) body.volume[i] = signed_area(cells[i]);
  // A cell on the contour lies inside of its two segments; at an inward corner it lacks only what is outside
  // of both.
  Polygon scratch;
  for (const Outline& outline : body.outlines) {
    const std::size_t count = outline.particle.size();
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t i = outline.particle[k], before = outline.particle[(k + count - 1) % count],
                        after = outline.particle[(k + 1) % count];
      const auto at = [&](std::size_t p) { return Point{body.position[2 * p], body.position[2 * p + 1]}; };
      const Point in = at(i) - at(before), out = at(after) - at(i);
      const Point n0{-in[1], in[0]}, n1{-out[1], out[0]};  // outward: left of a clockwise walk
      Polygon cell = cells[i];
      if (cross(in, out) <= 0) {
        cut(cell, n0, 0, scratch);
        cut(cell, n1, 0, scratch);
        body.volume[i] = signed_area(cell);
      } else {
        const double whole = signed_area(cell);
        cut(cell, {-n0[0], -n0[1]}, 0, scratch);
        cut(cell, {-n1[0], -n1[1]}, 0, scratch);
        body.volume[i] = whole - signed_area(cell);
      }
      if (!(body.volume[i] > 0)) throw std::invalid_argument("an outline is finer than the spacing resolves");
    }
  }
  body.energy_volume = body.volume;
  body.mass.clear();
  for (const double v : body.volume) body.mass.push_back(options.density * v);
  return body;
}

}  // namespace estuary::solid
