#include "wet_load.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::fluid {
namespace {

// A linear fit whose weights add up to more than this in absolute value would amplify errors: the nodes lie
// too much in a line.
constexpr double largest_amplification = 6.0;
// How far the nearest fluid node is looked for [spacings].
constexpr int nearest_reach = 12;

// Whether segment s crosses the way from p to q, other than at p itself: p lies on the surface, where
// periodic images and parts of one straight side may touch it.
bool hides(const Segment& s, double px, double py, double qx, double qy) {
  constexpr double at_start = 1e-6;  // fraction of the way
  const double dx = qx - px;
  const double dy = qy - py;
  const double side_a = dx * (s.ay - py) - dy * (s.ax - px);
  const double side_b = dx * (s.by - py) - dy * (s.bx - px);
  if ((side_a > 0) == (side_b > 0) && side_a != 0 && side_b != 0) return false;
  const double tx = s.bx - s.ax;
  const double ty = s.by - s.ay;
  const double side_p = tx * (py - s.ay) - ty * (px - s.ax);
  const double side_q = tx * (qy - s.ay) - ty * (qx - s.ax);
  if ((side_p > 0) == (side_q > 0)) return false;
  return std::abs(side_p) > at_start * std::abs(side_p - side_q);
}

double distance_to(const Segment& s, double x, double y) {
  const double tx = s.bx - s.ax;
  const double ty = s.by - s.ay;
  const double square = tx * tx + ty * ty;
  const double r = square > 0 ? std::clamp(((x - s.ax) * tx + (y - s.ay) * ty) / square, 0.0, 1.0) : 0.0;
  return std::hypot(x - s.ax - r * tx, y - s.ay - r * ty);
}

std::array<double, D2Q9::count> reaching(const Populations& populations, Node at) {
  const std::ptrdiff_t node = populations.node(at.x, at.y);
  std::array<double, D2Q9::count> f;
  for (int i = 0; i < D2Q9::count; ++i)
    f[static_cast<std::size_t>(i)] = populations[populations.incoming(populations.parity(), i, node)];
  return f;
}

// From 0 at the surface to 1 one spacing away from it: a node that the surface covers has lost its say
// before.
double say_of(double clearance) {
  const double t = std::min(clearance, 1.0);
  return t * t * (3 - 2 * t);
}

}  // namespace

// In coordinates of the grid, whose periodic sides a surface may have left.
WetLoad::WetNode WetLoad::in_grid(const Surface& surface, const Grid& grid, std::uint32_t wet_node) const {
  double px = surface.positions()[2 * wet_node];
  double py = surface.positions()[2 * wet_node + 1];
  if (grid.periodic_x) px -= std::floor((px + 0.5) / grid.nx) * grid.nx;
  if (grid.periodic_y) py -= std::floor((py + 0.5) / grid.ny) * grid.ny;
  return {wet_node, px, py, normals_[2 * wet_node], normals_[2 * wet_node + 1]};
}

void WetLoad::find_near_segments(const Surface& surface, const WetNode& wet, double reach) {
  near_.clear();
  for (const Segment& s : surface.segments()) {
    if (std::max(s.ax, s.bx) < wet.x - reach || std::min(s.ax, s.bx) > wet.x + reach) continue;
    if (std::max(s.ay, s.by) < wet.y - reach || std::min(s.ay, s.by) > wet.y + reach) continue;
    near_.push_back(&s);
  }
}

bool WetLoad::hidden(const WetNode& wet, double x, double y) const {
  return std::any_of(near_.begin(), near_.end(), [&](const Segment* s) {
    return s->a != wet.index && s->b != wet.index && hides(*s, wet.x, wet.y, x, y);
  });
}

void WetLoad::find_visible(const Surface& surface, const Cells& cells, const WetNode& wet) {
  const Grid& grid = cells.grid();
  candidates_.clear();
  if (!(wet.x > -radius && wet.x < grid.nx + radius && wet.y > -radius && wet.y < grid.ny + radius)) return;
  find_near_segments(surface, wet, radius);
  for (int y = static_cast<int>(std::ceil(wet.y - radius)); y <= static_cast<int>(std::floor(wet.y + radius));
       ++y) {
    for (int x = static_cast<int>(std::ceil(wet.x - radius));
         x <= static_cast<int>(std::floor(wet.x + radius)); ++x) {
      const Node node{grid.wrap_x(x), grid.wrap_y(y)};
      if (!grid.inside(node.x, node.y) || !cells.fluid(node.x, node.y)) continue;
      const double dx = x - wet.x;
      const double dy = y - wet.y;
      const double fraction = (dx * dx + dy * dy) / (radius * radius);
      const double ahead = dx * wet.normal_x + dy * wet.normal_y;
      if (fraction >= 1 || ahead <= 0 || hidden(wet, x, y)) continue;
      double clearance = ahead;
      for (const Segment* s : near_) clearance = std::min(clearance, distance_to(*s, x, y));
      const double weight = (1 - fraction) * (1 - fraction) * say_of(clearance);
      if (weight > 0) candidates_.push_back({node, dx, dy, weight});
    }
  }
}

// A node that no fluid lies in front of, as on the face of a body that stands outside the grid, must not take
// the pressure that acts on the other face.
bool WetLoad::find_nearest(const Surface& surface, const Cells& cells, const WetNode& wet) {
  const Grid& grid = cells.grid();
  double best = nearest_reach * nearest_reach;
  candidates_.clear();
  if (!(std::abs(wet.x) < 1e9 && std::abs(wet.y) < 1e9)) return false;
  find_near_segments(surface, wet, nearest_reach);
  const int x0 = static_cast<int>(std::lround(wet.x));
  const int y0 = static_cast<int>(std::lround(wet.y));
  for (int y = y0 - nearest_reach; y <= y0 + nearest_reach; ++y) {
    for (int x = x0 - nearest_reach; x <= x0 + nearest_reach; ++x) {
      const Node node{grid.wrap_x(x), grid.wrap_y(y)};
      const double dx = x - wet.x;
      const double dy = y - wet.y;
      const double square = dx * dx + dy * dy;
      if (square >= best || dx * wet.normal_x + dy * wet.normal_y <= 0) continue;
      if (!grid.inside(node.x, node.y) || !cells.fluid(node.x, node.y) || hidden(wet, x, y)) continue;
      best = square;
      candidates_.assign(1, {node, dx, dy, 1.0});
    }
  }
  return !candidates_.empty();
}

// The fitted value at the wet node is the first coefficient of the fit, a weighted sum of the values: weights
// from the first row of the inverse of the matrix of moments.
bool WetLoad::fit_linear() {
  if (candidates_.size() < 3) return false;
  double m00 = 0, m01 = 0, m02 = 0, m11 = 0, m12 = 0, m22 = 0;
  for (const Support& s : candidates_) {
    m00 += s.weight;
    m01 += s.weight * s.dx;
    m02 += s.weight * s.dy;
    m11 += s.weight * s.dx * s.dx;
    m12 += s.weight * s.dx * s.dy;
    m22 += s.weight * s.dy * s.dy;
  }
  const double c0 = m11 * m22 - m12 * m12;
  const double c1 = m02 * m12 - m01 * m22;
  const double c2 = m01 * m12 - m02 * m11;
  const double determinant = m00 * c0 + m01 * c1 + m02 * c2;
  if (!(determinant > 1e-12 * m00 * m00 * m00)) return false;
  double amplification = 0;
  for (const Support& s : candidates_) {
    amplification += std::abs(s.weight * (c0 + c1 * s.dx + c2 * s.dy) / determinant);
  }
  if (amplification > largest_amplification) return false;
  for (Support& s : candidates_) s.weight *= (c0 + c1 * s.dx + c2 * s.dy) / determinant;
  return true;
}

void WetLoad::fit_mean() {
  double sum = 0;
  for (const Support& s : candidates_) sum += s.weight;
  for (Support& s : candidates_) s.weight /= sum;
}

void WetLoad::build(const Surface& surface, const Cells& cells) {
  supports_.clear();
  first_.assign(1, 0);
  counts_ = {};
  normals_ = surface.node_normals();
  for (std::uint32_t n = 0; n < surface.node_count(); ++n) {
    const WetNode wet = in_grid(surface, cells.grid(), n);
    find_visible(surface, cells, wet);
    if (fit_linear()) {
      ++counts_.linear;
    } else if (!candidates_.empty()) {
      fit_mean();
      ++counts_.mean;
    } else if (find_nearest(surface, cells, wet)) {
      ++counts_.nearest;
    } else {
      ++counts_.without;
    }
    supports_.insert(supports_.end(), candidates_.begin(), candidates_.end());
    first_.push_back(supports_.size());
  }
}

void WetLoad::share_populations(const Populations& populations, Ranks* ranks) {
  shared_.clear();
  if (ranks == nullptr) return;
  shared_.assign(D2Q9::count * supports_.size(), 0.0);
  for (std::size_t k = 0; k < supports_.size(); ++k) {
    if (!populations.owns(supports_[k].node.y)) continue;
    const auto f = reaching(populations, supports_[k].node);
    std::copy(f.begin(), f.end(), shared_.begin() + static_cast<std::ptrdiff_t>(f.size() * k));
  }
  share(ranks, shared_);
}

void WetLoad::evaluate(const Populations& populations, EquilibriumModel model, Rates rates,
                       std::vector<double>& pressure, std::vector<double>* traction, Ranks* ranks) {
  share_populations(populations, ranks);
  const std::size_t nodes = first_.size() - 1;
  pressure.assign(nodes, 0.0);
  if (traction != nullptr) traction->assign(2 * nodes, 0.0);
  const double factor = -(1 - 0.5 * rates.even);
  for (std::size_t n = 0; n < nodes; ++n) {
    double xx = 0;
    double xy = 0;
    double yy = 0;
    for (std::size_t k = first_[n]; k < first_[n + 1]; ++k) {
      const Support& s = supports_[k];
      std::array<double, D2Q9::count> f;
      if (shared_.empty()) {
        f = reaching(populations, s.node);
      } else {
        std::copy_n(shared_.begin() + static_cast<std::ptrdiff_t>(f.size() * k), f.size(), f.begin());
      }
      const Moments m = moments_of<D2Q9>(f);
      pressure[n] += s.weight * D2Q9::sound_speed_squared * m.excess;
      if (traction == nullptr) continue;
      const double inverse =
          model == EquilibriumModel::compressible ? Compressible::inverse_density(m.excess) : 1.0;
      for (int i = 1; i < D2Q9::count; ++i) {
        const auto& c = D2Q9::velocity[static_cast<std::size_t>(i)];
        const double part =
            s.weight * factor * (f[static_cast<std::size_t>(i)] - equilibrium<D2Q9>(i, m, inverse));
        xx += c[0] * c[0] * part;
        xy += c[0] * c[1] * part;
        yy += c[1] * c[1] * part;
      }
    }
    if (traction == nullptr) continue;
    (*traction)[2 * n] = xx * normals_[2 * n] + xy * normals_[2 * n + 1];
    (*traction)[2 * n + 1] = xy * normals_[2 * n] + yy * normals_[2 * n + 1];
  }
}

void match_total(const Surface& surface, const Force& force, bool match_moment,
                 const std::vector<double>& pressure, std::vector<double>& traction) {
  const auto& x = surface.positions();
  const auto& connectivity = surface.connectivity();
  double length = 0;
  double centre_x = 0;
  double centre_y = 0;
  double missing_x = force.x;
  double missing_y = force.y;
  double missing_moment = force.moment;
  for (std::size_t s = 0; s + 1 < connectivity.size(); s += 2) {
    const std::size_t a = connectivity[s];
    const std::size_t b = connectivity[s + 1];
    const double tx = x[2 * b] - x[2 * a];
    const double ty = x[2 * b + 1] - x[2 * a + 1];
    const double segment = std::hypot(tx, ty);
    length += segment;
    centre_x += segment * 0.5 * (x[2 * a] + x[2 * b]);
    centre_y += segment * 0.5 * (x[2 * a + 1] + x[2 * b + 1]);
    // Load per segment at its ends: pressure against the normal (-ty, tx), and the traction.
    const double ax = pressure[a] * ty + segment * traction[2 * a];
    const double ay = -pressure[a] * tx + segment * traction[2 * a + 1];
    const double bx = pressure[b] * ty + segment * traction[2 * b];
    const double by = -pressure[b] * tx + segment * traction[2 * b + 1];
    const double at_a_x = (2 * ax + bx) / 6;
    const double at_a_y = (2 * ay + by) / 6;
    const double at_b_x = (ax + 2 * bx) / 6;
    const double at_b_y = (ay + 2 * by) / 6;
    missing_x -= at_a_x + at_b_x;
    missing_y -= at_a_y + at_b_y;
    missing_moment -= x[2 * a] * at_a_y - x[2 * a + 1] * at_a_x + x[2 * b] * at_b_y - x[2 * b + 1] * at_b_x;
  }
  if (!(length > 0)) return;
  centre_x /= length;
  centre_y /= length;
  double inertia = 0;
  for (std::size_t s = 0; s + 1 < connectivity.size(); s += 2) {
    const std::size_t a = connectivity[s];
    const std::size_t b = connectivity[s + 1];
    const double ax = x[2 * a] - centre_x;
    const double ay = x[2 * a + 1] - centre_y;
    const double bx = x[2 * b] - centre_x;
    const double by = x[2 * b + 1] - centre_y;
    inertia += std::hypot(bx - ax, by - ay) / 3 * (ax * ax + ay * ay + ax * bx + ay * by + bx * bx + by * by);
  }
  const double about_centre = missing_moment - centre_x * missing_y + centre_y * missing_x;
  const double turning = match_moment && inertia > 0 ? about_centre / inertia : 0;
  for (std::size_t n = 0; n < surface.node_count(); ++n) {
    traction[2 * n] += missing_x / length - turning * (x[2 * n + 1] - centre_y);
    traction[2 * n + 1] += missing_y / length + turning * (x[2 * n] - centre_x);
  }
}

void match_nodes(const Surface& surface, const std::vector<double>& node_forces,
                 const std::vector<double>& pressure, std::vector<double>& traction) {
  const auto& x = surface.positions();
  const auto& connectivity = surface.connectivity();
  std::vector<double> length(surface.node_count(), 0.0);
  traction = node_forces;
  for (std::size_t s = 0; s + 1 < connectivity.size(); s += 2) {
    const std::size_t a = connectivity[s];
    const std::size_t b = connectivity[s + 1];
    const double tx = x[2 * b] - x[2 * a];
    const double ty = x[2 * b + 1] - x[2 * a + 1];
    const double half = 0.5 * std::hypot(tx, ty);
    const double at_a = (2 * pressure[a] + pressure[b]) / 6;
    const double at_b = (pressure[a] + 2 * pressure[b]) / 6;
    length[a] += half;
    length[b] += half;
    // The pressure's own share acts against the normal (-ty, tx).
    traction[2 * a] -= at_a * ty;
    traction[2 * a + 1] += at_a * tx;
    traction[2 * b] -= at_b * ty;
    traction[2 * b + 1] += at_b * tx;
  }
  for (std::size_t n = 0; n < surface.node_count(); ++n) {
    const double inverse = length[n] > 0 ? 1 / length[n] : 0.0;
    traction[2 * n] *= inverse;
    traction[2 * n + 1] *= inverse;
  }
}

}  // namespace estuary::fluid
