#include "contact.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::solid {
namespace {

// A point deeper than this is on its way out of the other side [spacings].
constexpr double kDeepest = 0.9;
// Contours face each other where the cosine between their normals is below this.
constexpr double kFacing = -0.1;
constexpr std::size_t kMostCells = 1U << 16U;

}  // namespace

Contact::Contact(const Body& body, const ContactSettings& settings)
    : body_(body), settings_(settings), spacing_(body.mean_spacing()), place_(body.size(), 0) {
  std::vector<double> length(body.size(), 0.0);
  for (std::size_t o = 0; o < body.outlines.size(); ++o) {
    const auto& particles = body.outlines[o].particle;
    const auto n = static_cast<std::uint32_t>(particles.size());
    const auto first = static_cast<std::uint32_t>(segments_.size());
    for (std::uint32_t k = 0; k < n; ++k) {
      const std::uint32_t a = particles[k], b = particles[(k + 1) % n];
      const double l = std::hypot(body.position[2 * b] - body.position[2 * a],
                                  body.position[2 * b + 1] - body.position[2 * a + 1]);
      segments_.push_back({.a = a,
                           .b = b,
                           .before = first + (k + n - 1) % n,
                           .after = first + (k + 1) % n,
                           .member = static_cast<std::uint8_t>(body.outline_member[o]),
                           .length = l,
                           .torn = false});
      place_[a] = static_cast<std::uint32_t>(particle_.size());
      particle_.push_back(a);
      length[a] += 0.5 * l;
      length[b] += 0.5 * l;
    }
  }
  position_.resize(2 * particle_.size());
  const std::size_t members = body.member.empty() ? 0 : std::size_t{body.member.back()} + 1;
  boxes_.resize(members);
  body_force_.assign(2 * members, 0.0);
  near_.reserve(segments_.size());
  cell_segment_.reserve(segments_.size());
  cell_of_.reserve(segments_.size());
  cell_first_.reserve(kMostCells + 1);
  // Two masses against each other on the stiffness that both share (Gershgorin).
  for (const std::uint32_t i : particle_) {
    double k = 0;
    for (std::size_t other = 0; other < members; ++other)
      if (other != body.member[i]) k = std::max(k, stiffness(body.member[i], other));
    if (body.mass[i] > 0) squared_frequency_ = std::max(squared_frequency_, 2 * k * length[i] / body.mass[i]);
  }
  for (const RigidBody& rigid : body.rigid) {
    double k = 0, perimeter = 0;
    for (std::size_t other = 0; other < members; ++other)
      if (other != rigid.member) k = std::max(k, stiffness(rigid.member, other));
    for (std::size_t i = rigid.first; i < rigid.last; ++i) perimeter += length[i];
    if (!(rigid.held[0] && rigid.held[1] && rigid.held[2]))
      squared_frequency_ = std::max(squared_frequency_, 2 * k * perimeter / rigid.mass);
  }
}

void Contact::tear(std::span<const std::array<std::uint32_t, 2>> pieces) {
  for (Segment& segment : segments_)
    segment.torn = std::find(pieces.begin(), pieces.end(), std::array{segment.a, segment.b}) != pieces.end();
}

double Contact::stiffness(std::size_t member, std::size_t other) const {
  const double a = settings_.modulus[member], b = settings_.modulus[other];
  const double modulus = a > 0 && b > 0 ? std::min(a, b) : a > 0 ? a : b > 0 ? b : settings_.rigid_modulus;
  return modulus / spacing_;
}

// Boxes round the bodies; false when none meet.
bool Contact::find_region() {
  for (Box& box : boxes_) box = {{1e300, 1e300}, {-1e300, -1e300}};
  longest_ = 0;
  for (const Segment& segment : segments_) {
    const double *a = at(segment.a), *b = at(segment.b);
    const double length = std::hypot(b[0] - a[0], b[1] - a[1]);
    if (!std::isfinite(length)) throw ContactLost(segment.a, length);
    longest_ = std::max(longest_, length);
    Box& box = boxes_[segment.member];
    for (std::size_t c = 0; c < 2; ++c) {
      box.low[c] = std::min(box.low[c], a[c]);
      box.high[c] = std::max(box.high[c], a[c]);
    }
  }
  region_ = {{1e300, 1e300}, {-1e300, -1e300}};
  bool met = false;
  for (std::size_t m = 0; m < boxes_.size(); ++m)
    for (std::size_t o = m + 1; o < boxes_.size(); ++o) {
      double low[2], high[2];
      for (std::size_t c = 0; c < 2; ++c) {
        low[c] = std::max(boxes_[m].low[c], boxes_[o].low[c]);
        high[c] = std::min(boxes_[m].high[c], boxes_[o].high[c]);
      }
      if (!(low[0] <= high[0] && low[1] <= high[1])) continue;
      met = true;
      for (std::size_t c = 0; c < 2; ++c) {
        region_.low[c] = std::min(region_.low[c], low[c] - spacing_);
        region_.high[c] = std::max(region_.high[c], high[c] + spacing_);
      }
    }
  return met;
}

// Segments of the region by the cell of their middle. A point meets those of the nine cells round its own.
void Contact::sort_into_cells() {
  const double width = region_.high[0] - region_.low[0], height = region_.high[1] - region_.low[1];
  cell_ = kDeepest * spacing_ + 0.5 * longest_;
  while (width / cell_ * (height / cell_) > static_cast<double>(kMostCells) / 4 || width / cell_ > 1e4 ||
         height / cell_ > 1e4)
    cell_ *= 2;
  columns_ = static_cast<std::size_t>(width / cell_) + 1;
  rows_ = static_cast<std::size_t>(height / cell_) + 1;
  cell_first_.assign(columns_ * rows_ + 1, 0);
  near_.clear();
  cell_of_.clear();
  const double slip = 0.5 * longest_;
  for (std::uint32_t s = 0; s < segments_.size(); ++s) {
    if (segments_[s].torn) continue;
    const double *a = at(segments_[s].a), *b = at(segments_[s].b);
    const double x = 0.5 * (a[0] + b[0]), y = 0.5 * (a[1] + b[1]);
    if (x < region_.low[0] - slip || x > region_.high[0] + slip || y < region_.low[1] - slip ||
        y > region_.high[1] + slip)
      continue;
    const auto column = static_cast<std::size_t>(
        std::clamp((x - region_.low[0]) / cell_, 0.0, static_cast<double>(columns_ - 1)));
    const auto row = static_cast<std::size_t>(
        std::clamp((y - region_.low[1]) / cell_, 0.0, static_cast<double>(rows_ - 1)));
    near_.push_back(s);
    cell_of_.push_back(static_cast<std::uint32_t>(row * columns_ + column));
    ++cell_first_[cell_of_.back() + 1];
  }
  for (std::size_t c = 0; c < columns_ * rows_; ++c) cell_first_[c + 1] += cell_first_[c];
  cell_segment_.resize(near_.size());
  // Filled from behind, cell_first_[c + 1] ends up at the cell's start, and the order stays ascending.
  for (std::size_t k = near_.size(); k-- > 0;) cell_segment_[--cell_first_[cell_of_[k] + 1]] = near_[k];
}

void Contact::consider(std::uint32_t s, double x, double y, const double* own_normal, double& best,
                       Foot& foot, bool& inside) const {
  const Segment& segment = segments_[s];
  const double *a = at(segment.a), *b = at(segment.b);
  const double tx = b[0] - a[0], ty = b[1] - a[1], l2 = tx * tx + ty * ty;
  if (!(l2 > 0)) return;
  const double l = std::sqrt(l2), nx = -ty / l, ny = tx / l;
  if (nx * own_normal[0] + ny * own_normal[1] > kFacing) return;
  const double t = ((x - a[0]) * tx + (y - a[1]) * ty) / l2;
  if (t >= 0 && t <= 1) {
    const double height = (x - a[0]) * nx + (y - a[1]) * ny;
    if (std::abs(height) >= best) return;
    best = std::abs(height);
    inside = height < 0;
    foot = {segment.a, segment.b, t, {nx, ny}, -height};
    return;
  }
  // A corner; inside of it when behind both of its segments' mean.
  const Segment& next = segments_[t < 0 ? segment.before : segment.after];
  if (next.torn) return;
  const double *c = at(next.a), *d = at(next.b);
  const double ux = d[0] - c[0], uy = d[1] - c[1], m = std::hypot(ux, uy);
  if (!(m > 0)) return;
  const double* corner = t < 0 ? a : b;
  const double ox = x - corner[0], oy = y - corner[1], distance = std::hypot(ox, oy);
  if (distance >= best || !(distance > 0)) return;
  best = distance;
  inside = ox * (nx - uy / m) + oy * (ny + ux / m) < 0;
  foot = {segment.a, segment.b, t < 0 ? 0.0 : 1.0, {-ox / distance, -oy / distance}, distance};
}

bool Contact::nearest(double x, double y, const double* own_normal, std::size_t member, Foot& foot) const {
  const auto column = static_cast<std::ptrdiff_t>((x - region_.low[0]) / cell_),
             row = static_cast<std::ptrdiff_t>((y - region_.low[1]) / cell_);
  double best = 1.5 * spacing_;
  bool inside = false;
  for (std::ptrdiff_t r = std::max<std::ptrdiff_t>(0, row - 1);
       r < std::min(static_cast<std::ptrdiff_t>(rows_), row + 2); ++r)
    for (std::ptrdiff_t c = std::max<std::ptrdiff_t>(0, column - 1);
         c < std::min(static_cast<std::ptrdiff_t>(columns_), column + 2); ++c) {
      const std::size_t cell = static_cast<std::size_t>(r) * columns_ + static_cast<std::size_t>(c);
      const std::size_t end = cell + 1 < columns_ * rows_ ? cell_first_[cell + 2] : cell_segment_.size();
      for (std::size_t k = cell_first_[cell + 1]; k < end; ++k)
        if (segments_[cell_segment_[k]].member != member)
          consider(cell_segment_[k], x, y, own_normal, best, foot, inside);
    }
  return inside;
}

void Contact::add_to(std::span<const double> displacement, std::vector<double>& force) {
  energy_ = 0;
  touching_ = false;
  std::fill(body_force_.begin(), body_force_.end(), 0.0);
  for (std::size_t k = 0; k < particle_.size(); ++k)
    for (std::size_t c = 0; c < 2; ++c)
      position_[2 * k + c] = body_.position[2 * particle_[k] + c] + displacement[2 * particle_[k] + c];
  if (!find_region()) return;
  sort_into_cells();
  const double gauss = 0.5 / std::sqrt(3.0);
  for (const std::uint32_t s : near_) {
    const Segment& segment = segments_[s];
    const double *a = at(segment.a), *b = at(segment.b);
    const double l = std::hypot(b[0] - a[0], b[1] - a[1]);
    const double own_normal[2] = {-(b[1] - a[1]) / l, (b[0] - a[0]) / l};
    for (const double share : {0.5 - gauss, 0.5 + gauss}) {
      const double x = a[0] + share * (b[0] - a[0]), y = a[1] + share * (b[1] - a[1]);
      if (x < region_.low[0] || x > region_.high[0] || y < region_.low[1] || y > region_.high[1]) continue;
      Foot foot{};
      if (!nearest(x, y, own_normal, segment.member, foot)) continue;
      if (foot.depth > kDeepest * spacing_) throw ContactLost(segment.a, foot.depth / spacing_);
      const std::size_t other = body_.member[foot.a];
      const double k = 0.25 * stiffness(segment.member, other) * segment.length;
      const double size = k * foot.depth;
      touching_ = true;
      energy_ += 0.5 * size * foot.depth;
      for (std::size_t c = 0; c < 2; ++c) {
        const double f = size * foot.normal[c];
        force[2 * segment.a + c] += (1 - share) * f;
        force[2 * segment.b + c] += share * f;
        force[2 * foot.a + c] -= (1 - foot.share) * f;
        force[2 * foot.b + c] -= foot.share * f;
        body_force_[2 * segment.member + c] += f;
        body_force_[2 * other + c] -= f;
      }
    }
  }
}

}  // namespace estuary::solid
