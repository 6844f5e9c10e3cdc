#include "neighbourhood.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "consistent_gradient.hpp"
#include "kernel_function.hpp"
#include "moving_least_squares.hpp"

namespace estuary::solid {

ReferenceSearch::ReferenceSearch(const Body& body, double cell)
    : body_(body), cell_(cell), period_(body.box.periodic ? body.box.length(0) : 0.0) {
  double high[2];
  for (int c = 0; c < 2; ++c) origin_[c] = high[c] = body.position[static_cast<std::size_t>(c)];
  for (std::size_t i = 0; i < body.particles(); ++i)
    for (std::size_t c = 0; c < 2; ++c) {
      origin_[c] = std::min(origin_[c], body.position[2 * i + c]);
      high[c] = std::max(high[c], body.position[2 * i + c]);
    }
  for (int c = 0; c < 2; ++c) cells_[c] = static_cast<std::int64_t>((high[c] - origin_[c]) / cell_) + 1;
  content_.resize(static_cast<std::size_t>(cells_[0] * cells_[1]));
  for (std::size_t i = 0; i < body.particles(); ++i) {
    const auto cx = static_cast<std::int64_t>((body.position[2 * i] - origin_[0]) / cell_);
    const auto cy = static_cast<std::int64_t>((body.position[2 * i + 1] - origin_[1]) / cell_);
    content_[static_cast<std::size_t>(cy * cells_[0] + cx)].push_back(static_cast<std::uint32_t>(i));
  }
}

std::vector<ReferenceSearch::Found> ReferenceSearch::within(double x, double y, double radius) const {
  std::vector<Found> found;
  const int images = period_ > 0 ? static_cast<int>(radius / period_) + 1 : 0;
  const auto cell_of = [&](double value, int c) {
    return static_cast<std::int64_t>(std::floor((value - origin_[c]) / cell_));
  };
  for (int image = -images; image <= images; ++image) {
    const double px = x + image * period_;
    const auto clamp = [](std::int64_t v, std::int64_t n) { return std::clamp<std::int64_t>(v, 0, n); };
    const std::int64_t x0 = clamp(cell_of(px - radius, 0), cells_[0]);
    const std::int64_t x1 = clamp(cell_of(px + radius, 0) + 1, cells_[0]);
    const std::int64_t y0 = clamp(cell_of(y - radius, 1), cells_[1]);
    const std::int64_t y1 = clamp(cell_of(y + radius, 1) + 1, cells_[1]);
    for (std::int64_t cy = y0; cy < y1; ++cy)
      for (std::int64_t cx = x0; cx < x1; ++cx)
        for (const std::uint32_t j : content_[static_cast<std::size_t>(cy * cells_[0] + cx)]) {
          const double ox = body_.position[2 * j] - px, oy = body_.position[2 * j + 1] - y;
          if (ox * ox + oy * oy <= radius * radius) found.push_back({j, ox, oy});
        }
  }
  std::sort(found.begin(), found.end(), [](const Found& a, const Found& b) {
    return a.particle != b.particle ? a.particle < b.particle : a.x < b.x;
  });
  return found;
}

namespace {

// At an edge the smallest neighbourhood cannot tell a slope from a curvature across the edge; each factor
// adds about one ring of particles until it can.
constexpr std::array kWidening{1.0, 1.4, 1.85};

std::string at_particle(const Body& body, std::size_t i) {
  return "particle " + std::to_string(i) + " at (" + std::to_string(body.position[2 * i]) + ", " +
         std::to_string(body.position[2 * i + 1]) + "): ";
}

GradientRow gradient_row(const Body& body, const ReferenceSearch& search, std::size_t i, Order order,
                         Kernel kernel) {
  GradientRow row;
  const double scale = body.mean_spacing();
  const bool at_stress_point = i >= body.particles();
  for (const double widening : kWidening) {
    const double h = body.smoothing_length * widening;
    GradientRow candidate;
    std::vector<Offset> offsets;
    for (const auto& found :
         search.within(body.position[2 * i], body.position[2 * i + 1], support_ratio(kernel) * h)) {
      const double r = std::hypot(found.x, found.y);
      if (body.member[found.particle] != body.member[i]) continue;  // bodies meet by contact only
      if (r < 1e-6 * scale) continue;  // the particle itself; its own images in a narrow periodic body count
      // Without V_j, which is the same for all but the half cells on a side: there it would tilt the stencil
      // of the next row and cost an order.
      const double weight = at_stress_point ? kernel_value(kernel, r, h) : -kernel_slope(kernel, r, h) / r;
      if (!(weight > 0)) continue;
      candidate.neighbour.push_back(found.particle);
      candidate.offset.push_back({found.x, found.y});
      candidate.weight.push_back(weight);
      offsets.push_back({found.x / scale, found.y / scale});
    }
    if (order == Order::none || order == Order::shepard) {
      const double self = kernel_value(kernel, 0, h) * body.volume[i];
      double sum = order == Order::shepard ? self : 1.0;
      for (std::size_t k = 0; order == Order::shepard && k < candidate.neighbour.size(); ++k)
        sum += body.volume[candidate.neighbour[k]] *
               kernel_value(kernel, std::hypot(candidate.offset[k][0], candidate.offset[k][1]), h);
      for (std::size_t k = 0; k < candidate.neighbour.size(); ++k) {
        const double w = candidate.weight[k] * body.volume[candidate.neighbour[k]] / sum;
        candidate.gradient.push_back({w * candidate.offset[k][0], w * candidate.offset[k][1]});
      }
      return candidate;
    }
    if (is_moving_least_squares(order)) {
      offsets.insert(offsets.begin(), Offset{});
      try {
        const ShapeFunctions shape =
            moving_least_squares(offsets, kernel, h / scale, quadratic_exact(order) ? 2 : 1,
                                 is_diffuse(order) ? Derivative::diffuse : Derivative::full);
        for (std::size_t k = 1; k < offsets.size(); ++k)
          candidate.gradient.push_back({shape.gradient[k][0] / scale, shape.gradient[k][1] / scale});
      } catch (const std::domain_error&) {
        if (widening != kWidening.back()) continue;
        throw std::domain_error(at_particle(body, i) +
                                "too few neighbours for moving least squares of this order");
      }
      return candidate;
    }
    GradientWeights solved;
    try {
      solved = gradient_weights(offsets, candidate.weight, order, at_stress_point);
    } catch (const std::domain_error& error) {
      if (widening != kWidening.back()) continue;
      throw std::domain_error(at_particle(body, i) + error.what());
    }
    for (auto& g : solved.weights) g = {g[0] / scale, g[1] / scale};
    candidate.gradient = std::move(solved.weights);
    candidate.complete = solved.complete;
    // The narrowest neighbourhood that resolves everything; failing that, the narrowest of all.
    if (row.gradient.empty() || candidate.complete) row = std::move(candidate);
    if (row.complete || order == Order::linear) break;
  }
  return row;
}

}  // namespace

Neighbourhood build_neighbourhood(const Body& body, const NeighbourhoodOptions& options) {
  const std::size_t n = body.size();
  const double widest = support_ratio(options.kernel) * body.smoothing_length * kWidening.back();
  const ReferenceSearch search(body, widest);
  std::vector<GradientRow> rows(n);
  // A row on a side has half the weight of the others; with the one-sided linear difference that makes the
  // sums over rows obey summation by parts, and a wider one would not (Strand 1994).
  for (std::size_t i = 0; i < n; ++i) {
    if (body.carried(i)) continue;  // a rigid body has no strain
    const bool one_sided =
        quadratic_exact(options.order) && i < body.particles() && (body.edge[i] != 0 || body.fixed[i] == 3);
    rows[i] = gradient_row(body, search, i, one_sided ? Order::linear : options.order, options.kernel);
  }

  const bool corrected = options.order != Order::none && options.order != Order::shepard;
  if (corrected && !body.outlines.empty()) make_consistent(body, rows);

  struct Entry {
    std::uint32_t neighbour;
    double x, y, gx, gy, rx, ry;
  };
  std::vector<std::vector<Entry>> pairs(n);
  const auto entry = [&](std::size_t i, std::uint32_t j, double x, double y) -> Entry& {
    for (Entry& e : pairs[i])
      if (e.neighbour == j && std::abs(e.x - x) < 1e-6 * body.mean_spacing()) return e;
    return pairs[i].emplace_back(Entry{j, x, y, 0, 0, 0, 0});
  };
  Neighbourhood result;
  for (std::size_t i = 0; i < n; ++i) {
    if (!rows[i].complete) ++result.incomplete;
    for (std::size_t k = 0; k < rows[i].neighbour.size(); ++k) {
      const std::uint32_t j = rows[i].neighbour[k];
      const auto& offset = rows[i].offset[k];
      const auto& gradient = rows[i].gradient[k];
      Entry& forward = entry(i, j, offset[0], offset[1]);
      forward.gx = gradient[0];
      forward.gy = gradient[1];
      // A particle may meet its own image: the second entry then moves the first in memory.
      Entry& backward = entry(j, static_cast<std::uint32_t>(i), -offset[0], -offset[1]);
      backward.rx = gradient[0];
      backward.ry = gradient[1];
    }
  }
  result.first.push_back(0);
  result.gradient_sum.assign(2 * n, 0.0);
  const bool springs = !options.spring_modulus.empty();
  if (springs) result.spring_moment.assign(3 * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    std::sort(pairs[i].begin(), pairs[i].end(), [](const Entry& a, const Entry& b) {
      return a.neighbour != b.neighbour ? a.neighbour < b.neighbour : a.x < b.x;
    });
    for (const Entry& e : pairs[i]) {
      result.neighbour.push_back(e.neighbour);
      result.gradient.insert(result.gradient.end(), {e.gx, e.gy});
      result.reverse_gradient.insert(result.reverse_gradient.end(), {e.rx, e.ry});
      result.offset.insert(result.offset.end(), {e.x, e.y});
      result.gradient_sum[2 * i] += e.gx;
      result.gradient_sum[2 * i + 1] += e.gy;
      const double r = std::hypot(e.x, e.y);
      const double slope_over_r = -kernel_slope(options.kernel, r, body.smoothing_length) / r;
      if (springs) {
        // sum_j V_j |W'| R is 2 in the plane, so that a deviation of strain e costs spring_modulus e^2 / 2
        // per volume.
        const double k = 0.5 * options.spring_modulus[body.member[i]] * body.volume[i] *
                         body.volume[e.neighbour] * slope_over_r;
        result.spring.push_back(k);
        result.spring_moment[3 * i] += k * e.x * e.x;
        result.spring_moment[3 * i + 1] += k * e.x * e.y;
        result.spring_moment[3 * i + 2] += k * e.y * e.y;
      }
      if (options.viscous)
        result.viscous_weight.push_back(body.mass[i] * body.mass[e.neighbour] * slope_over_r);
    }
    result.first.push_back(static_cast<std::uint32_t>(result.neighbour.size()));
  }
  return result;
}

}  // namespace estuary::solid
