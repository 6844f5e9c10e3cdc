#include "surface_transfer.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>

#include "kernel_function.hpp"
#include "least_norm.hpp"

namespace estuary::solid {
namespace {

// Neighbourhood of a point in spacings: reaches the third row below a side.
constexpr double kReach = 2.7;
constexpr std::array kWidening{1.0, 1.3, 1.7, 2.3};

struct Corner {
  double x, y;
};

std::array<Corner, 2> ends(const Box& box, Side side) {
  const double x0 = box.from[0], x1 = box.to[0], y0 = box.from[1], y1 = box.to[1];
  switch (side) {
    case Side::left:
      return {{{x0, y0}, {x0, y1}}};
    case Side::top:
      return {{{x0, y1}, {x1, y1}}};
    case Side::right:
      return {{{x1, y1}, {x1, y0}}};
    case Side::bottom:
      break;
  }
  return {{{x1, y0}, {x0, y0}}};
}

std::uint8_t clamped_side_at(const Box& box, double x, double y) {
  const double slip = 1e-9 * box.spacing;
  const std::array<bool, 4> on{std::abs(x - box.from[0]) < slip, std::abs(y - box.to[1]) < slip,
                               std::abs(x - box.to[0]) < slip, std::abs(y - box.from[1]) < slip};
  for (std::size_t side = 0; side < 4; ++side)
    if (on[side] && box.clamped[side]) return static_cast<std::uint8_t>(side + 1);
  return 0;
}

struct Entry {
  std::uint32_t particle;
  double weight;
};

// How a point takes part in a transfer.
struct Point {
  double x = 0, y = 0;
  std::uint8_t held = 0;  // as in ContourLine
  Curvature curvature = Curvature::all;
  Offset tangent{};
};

std::vector<Entry> point_row(const Body& body, const ReferenceSearch& search, const Point& place) {
  const double d = body.mean_spacing();
  const bool vertical = place.held == 1 || place.held == 3;  // the clamped side the node lies on
  const double row_distance =
      body.box.clamp == Clamp::line ? 0 : 0.5 * (vertical ? body.spacing[0] : body.spacing[1]);
  for (const auto& found : search.within(place.x, place.y, 1e-6 * d)) return {{found.particle, 1.0}};
  for (const double widening : kWidening) {
    const double radius = kReach * widening * d;
    std::vector<Offset> offsets;
    std::vector<double> weights;
    std::vector<Entry> row;
    const auto candidates = search.within(place.x, place.y, radius);
    // Where bodies are close, that of the nearest particle counts.
    std::size_t member = 0;
    double nearest = 1e300;
    for (const auto& found : candidates)
      if (std::hypot(found.x, found.y) < nearest) {
        nearest = std::hypot(found.x, found.y);
        member = body.member[found.particle];
      }
    for (const auto& found : candidates) {
      if (body.member[found.particle] != member) continue;
      if (place.held != 0) {
        // A node on a clamp moves with the clamp: only the fixed row along that side counts.
        const double across = std::abs(vertical ? found.x : found.y);
        if (!body.fixed[found.particle] || std::abs(across - row_distance) > 1e-6 * d) continue;
      }
      // A watched point follows the particles next to it; a contour node takes the weights of least norm.
      const double weight = place.curvature == Curvature::all
                                ? cubic_spline(std::hypot(found.x, found.y), 0.5 * radius) * d * d
                                : 1.0;
      if (!(weight > 0)) continue;
      offsets.push_back({found.x / d, found.y / d});
      weights.push_back(weight);
      row.push_back({found.particle, 0});
    }
    try {
      const std::vector<double> solved =
          place.held != 0 ? value_weights_on_line(offsets, weights, vertical ? Offset{0, 1} : Offset{1, 0})
                          : value_weights(offsets, weights, place.curvature, place.tangent);
      for (std::size_t k = 0; k < row.size(); ++k) row[k].weight = solved[k];
      return row;
    } catch (const std::domain_error&) {
      if (widening == kWidening.back())
        throw std::domain_error("point (" + std::to_string(place.x) + ", " + std::to_string(place.y) +
                                "): too few particles near it");
    }
  }
  return {};
}

using EntryRows = std::vector<std::vector<Entry>>;

EntryRows point_rows(const Body& body, std::span<const Point> places) {
  const ReferenceSearch search(body, kReach * body.mean_spacing());
  EntryRows rows;
  for (const Point& place : places) rows.push_back(point_row(body, search, place));
  return rows;
}

// The least change of the shares that makes them reproduce linear fields on a contour that is curved or whose
// nodes are not evenly spaced.
template <class At>
void keep_linear(std::vector<double>& share, std::span<const Point> places, const At& at, std::ptrdiff_t k,
                 double spacing) {
  const auto reach = static_cast<std::ptrdiff_t>(share.size() / 2);
  Rows moments(3);
  for (std::ptrdiff_t offset = -reach; offset <= reach; ++offset) {
    const Point &place = places[at(k + offset)], &here = places[at(k)];
    moments[0].push_back(1);
    moments[1].push_back((place.x - here.x) / spacing);
    moments[2].push_back((place.y - here.y) / spacing);
  }
  const std::vector<double> gap{1 - dot(moments[0], share), -dot(moments[1], share), -dot(moments[2], share)};
  if (dot(gap, gap) < 1e-28) return;
  const LeastNorm conditions(std::move(moments));
  const std::vector<double> change = conditions.solve(gap, 1e-10 * conditions.largest());
  for (std::size_t column = 0; column < share.size(); ++column) share[column] += change[column];
}

// Combines the rows of neighbouring contour nodes so that a sawtooth along the contour, which the solid
// carries with little stiffness and the other side cannot resolve, is neither seen nor loaded. On straight
// stretches of even spacing cubic fields pass unchanged (the five-point filter of Shapiro 1970); next to
// corners, ends and clamps linear ones do.
EntryRows without_sawtooth(const Body& body, const EntryRows& rows, std::span<const Point> places,
                           bool closed) {
  const bool periodic = body.box.periodic;
  const auto n = static_cast<std::ptrdiff_t>(rows.size());
  const bool wraps = closed || periodic;
  const std::ptrdiff_t period = periodic ? n - 1 : n;  // both ends of a periodic line are one node
  const auto at = [&](std::ptrdiff_t k) {
    return static_cast<std::size_t>(wraps ? (k + 2 * period) % period : k);
  };
  const auto smooth = [&](std::ptrdiff_t k) {
    if (!wraps && (k <= 0 || k >= n - 1)) return false;
    const Point& place = places[at(k)];
    return place.held == 0 && place.curvature == Curvature::tangential;
  };
  EntryRows result;
  for (std::ptrdiff_t k = 0; k < n; ++k) {
    std::vector<double> share{1.0};
    if (smooth(k)) {
      if (smooth(k - 1) && smooth(k + 1))
        share = {-0.0625, 0.25, 0.625, 0.25, -0.0625};
      else
        share = {0.25, 0.5, 0.25};
      // A periodic line is straight and even, and its ends are a period apart.
      if (!periodic) keep_linear(share, places, at, k, body.mean_spacing());
    }
    std::vector<Entry> row;
    const auto reach = static_cast<std::ptrdiff_t>(share.size() / 2);
    for (std::ptrdiff_t o = -reach; o <= reach; ++o)
      for (const Entry& entry : rows[at(k + o)]) {
        const double weight = share[static_cast<std::size_t>(o + reach)] * entry.weight;
        const auto place = std::find_if(row.begin(), row.end(),
                                        [&](const Entry& e) { return e.particle == entry.particle; });
        if (place == row.end())
          row.push_back({entry.particle, weight});
        else
          place->weight += weight;
      }
    result.push_back(std::move(row));
  }
  return result;
}

Transfer assemble(const EntryRows& rows) {
  Transfer transfer;
  transfer.first.push_back(0);
  for (const auto& row : rows)
    for (const Entry& entry : row) transfer.touched.push_back(entry.particle);
  auto& touched = transfer.touched;
  std::sort(touched.begin(), touched.end());
  touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
  for (const auto& row : rows) {
    for (const Entry& entry : row) {
      const auto place = std::lower_bound(touched.begin(), touched.end(), entry.particle) - touched.begin();
      transfer.position.push_back(static_cast<std::uint32_t>(place));
      transfer.weight.push_back(entry.weight);
    }
    transfer.first.push_back(static_cast<std::uint32_t>(transfer.weight.size()));
  }
  return transfer;
}

}  // namespace

ContourLine contour_line(const Body& body, std::span<const Side> sides) {
  const Box& box = body.box;
  std::array<bool, 4> wanted{};
  for (const Side side : sides) wanted[static_cast<std::size_t>(side)] = true;
  const auto count = std::count(wanted.begin(), wanted.end(), true);
  if (count == 0) throw std::invalid_argument("no side is named");
  // The walk starts on the side whose predecessor is not wanted.
  std::size_t start = 4;
  int starts = 0;
  for (std::size_t s = 0; s < 4; ++s)
    if (wanted[s] && !wanted[(s + 3) % 4]) {
      start = s;
      ++starts;
    }
  if (starts > 1) throw std::invalid_argument("the sides do not follow one another round the box");
  ContourLine line;
  line.closed = count == 4;
  if (line.closed) start = 0;
  const auto add = [&](double x, double y) {
    line.position.insert(line.position.end(), {x, y});
    line.held.push_back(clamped_side_at(box, x, y));
  };
  for (std::size_t step = 0; step < static_cast<std::size_t>(count); ++step) {
    const auto side = static_cast<Side>((start + step) % 4);
    const auto [a, b] = ends(box, side);
    const std::size_t axis = side == Side::left || side == Side::right ? 1 : 0;
    const double segments = std::max(1.0, std::round(box.length(axis) / body.spacing[axis]));
    for (std::size_t k = 0; k < static_cast<std::size_t>(segments); ++k) {
      const double share = static_cast<double>(k) / segments;
      add(a.x + (b.x - a.x) * share, a.y + (b.y - a.y) * share);
    }
    if (step + 1 == static_cast<std::size_t>(count) && !line.closed) add(b.x, b.y);
  }
  return line;
}

std::vector<ContourLine> free_contours(const Body& body) {
  std::vector<ContourLine> lines;
  const auto add = [&](ContourLine& line, std::uint32_t i) {
    line.position.insert(line.position.end(), {body.position[2 * i], body.position[2 * i + 1]});
    line.held.push_back(0);
  };
  for (const Outline& outline : body.outlines) {
    const std::size_t n = outline.particle.size();
    if (n == 0) continue;
    const auto dry = [&](std::size_t k) {
      return body.fixed[outline.particle[k % n]] == 3 && body.fixed[outline.particle[(k + 1) % n]] == 3;
    };
    std::size_t start = n;
    for (std::size_t k = 0; k < n; ++k)
      if (!dry(k) && dry(k + n - 1)) start = k;
    if (start == n) {
      if (dry(0)) continue;
      ContourLine line;
      line.closed = true;
      for (const std::uint32_t i : outline.particle) add(line, i);
      lines.push_back(std::move(line));
      continue;
    }
    ContourLine line;
    for (std::size_t k = start; k < start + n; ++k) {
      if (dry(k)) continue;
      if (line.position.empty()) add(line, outline.particle[k % n]);
      add(line, outline.particle[(k + 1) % n]);
      if (dry(k + 1)) lines.push_back(std::exchange(line, {}));
    }
  }
  return lines;
}

Transfer contour_transfer(const Body& body, std::span<const ContourLine> lines) {
  EntryRows rows;
  for (const ContourLine& line : lines) {
    const std::size_t n = line.size();
    std::vector<Point> places;
    for (std::size_t k = 0; k < n; ++k) {
      Point place{.x = line.position[2 * k], .y = line.position[2 * k + 1], .held = line.held[k]};
      const bool has_both = line.closed || (k > 0 && k + 1 < n);
      const std::size_t before = has_both ? (k + n - 1) % n : (k == 0 ? k : k - 1);
      const std::size_t after = has_both ? (k + 1) % n : (k == 0 ? k + 1 : k);
      const double x0 = place.x - line.position[2 * before], y0 = place.y - line.position[2 * before + 1];
      const double x1 = line.position[2 * after] - place.x, y1 = line.position[2 * after + 1] - place.y;
      const double length = std::hypot(x0 + x1, y0 + y1);
      place.tangent = {(x0 + x1) / length, (y0 + y1) / length};
      // At a corner there is no one tangent; nor does a line end there have particles on both sides, unless
      // periodic.
      const bool corner = std::abs(std::atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1)) > std::numbers::pi / 9;
      const bool end = !has_both && !body.box.periodic;
      place.curvature = corner || end ? Curvature::none : Curvature::tangential;
      places.push_back(place);
    }
    EntryRows own = point_rows(body, places);
    // A rigid contour has no sawtooth.
    if (body.box.placement == Placement::on_contour && !body.carried(own.front().front().particle))
      own = without_sawtooth(body, own, places, line.closed);
    rows.insert(rows.end(), own.begin(), own.end());
  }
  return assemble(rows);
}

Transfer point_transfer(const Body& body, std::span<const double> points) {
  std::vector<Point> places;
  for (std::size_t k = 0; k < points.size() / 2; ++k)
    places.push_back({.x = points[2 * k], .y = points[2 * k + 1]});
  return assemble(point_rows(body, places));
}

void interpolate(const Transfer& transfer, std::span<const double> particle_values,
                 std::span<double> point_values) {
  for (std::size_t k = 0; k < transfer.points(); ++k) {
    double x = 0, y = 0;
    for (std::size_t e = transfer.first[k]; e < transfer.first[k + 1]; ++e) {
      const std::size_t j = transfer.touched[transfer.position[e]];
      x += transfer.weight[e] * particle_values[2 * j];
      y += transfer.weight[e] * particle_values[2 * j + 1];
    }
    point_values[2 * k] = x;
    point_values[2 * k + 1] = y;
  }
}

void spread(const Transfer& transfer, std::span<const double> point_forces,
            std::vector<double>& touched_forces) {
  touched_forces.assign(2 * transfer.touched.size(), 0.0);
  for (std::size_t k = 0; k < transfer.points(); ++k)
    for (std::size_t e = transfer.first[k]; e < transfer.first[k + 1]; ++e) {
      const std::size_t j = transfer.position[e];
      touched_forces[2 * j] += transfer.weight[e] * point_forces[2 * k];
      touched_forces[2 * j + 1] += transfer.weight[e] * point_forces[2 * k + 1];
    }
}

std::vector<double> uniform_traction(const ContourLine& line, double force_x, double force_y) {
  std::vector<double> force(line.position.size(), 0.0);
  double total = 0;
  const std::size_t n = line.size();
  const auto length = [&](std::size_t s) {
    const std::size_t a = s, b = (s + 1) % n;
    return std::hypot(line.position[2 * b] - line.position[2 * a],
                      line.position[2 * b + 1] - line.position[2 * a + 1]);
  };
  for (std::size_t s = 0; s < line.segments(); ++s) total += length(s);
  for (std::size_t s = 0; s < line.segments(); ++s)
    for (const std::size_t node : {s, (s + 1) % n}) {
      force[2 * node] += 0.5 * length(s) / total * force_x;
      force[2 * node + 1] += 0.5 * length(s) / total * force_y;
    }
  return force;
}

}  // namespace estuary::solid
