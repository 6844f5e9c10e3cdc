#include "pinball.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::solid {
namespace {

// In spacings: how near a surface makes a row, how far ahead candidates are looked for, and how deep a
// particle may be inside another body before it counts as outside of its far side.
constexpr double kNearBy = 0.5;
constexpr double kAhead = 1.0;
constexpr double kDeepestBall = 0.9;
// Of several faces a particle is behind, those deeper than this count only when they are the nearest.
constexpr double kBehind = 0.15;
// Faces with a cosine below this between their normals are the two sides of something.
constexpr double kBack = -0.5;
// A point on the end of a face belongs to it, and to the next one as well.
constexpr double kHair = 1e-6;
constexpr double kSame = 1 - 1e-6;

}  // namespace

Pinball::Pinball(const Body& body, PinballSettings settings)
    : body_(body),
      settings_(std::move(settings)),
      spacing_(body.mean_spacing()),
      rigid_of_(body.size(), kNone) {
  std::vector<std::uint8_t> carries(body.size(), 0);
  for (std::size_t o = 0; o < body.outlines.size(); ++o) {
    const Outline& outline = body.outlines[o];
    const auto member = static_cast<std::uint8_t>(body.outline_member[o]);
    const auto n = static_cast<std::uint32_t>(outline.particle.size());
    const std::uint32_t pieces = outline.closed ? n : n - 1;
    const auto first = static_cast<std::uint32_t>(segments_.size());
    for (std::uint32_t k = 0; k < pieces; ++k)
      segments_.push_back({.a = outline.particle[k],
                           .b = outline.particle[(k + 1) % n],
                           .before = k > 0            ? first + k - 1
                                     : outline.closed ? first + pieces - 1
                                                      : kNone,
                           .after = k + 1 < pieces   ? first + k + 1
                                    : outline.closed ? first
                                                     : kNone,
                           .member = member});
    for (const std::uint32_t i : outline.particle) carries[i] = 1;
  }
  torn_.assign(segments_.size(), 0);
  exposed_.assign(body.size(), 0);
  whole_ = segments_.size();
  for (std::uint32_t i = 0; i < body.size(); ++i)
    if (carries[i] != 0 || settings_.members[body.member[i]].fluid) points_.push_back(i);
  whole_points_ = points_.size();
  for (std::uint32_t r = 0; r < body.rigid.size(); ++r)
    for (std::uint32_t i = body.rigid[r].first; i < body.rigid[r].last; ++i) rigid_of_[i] = r;
  if (!settings_.friction) return;
  turns_.assign(body.size(), kNone);
  for (std::uint32_t i = 0, count = 0; i < body.size(); ++i)
    if (settings_.members[body.member[i]].two_sided) turns_[i] = count++;
}

void Pinball::tear(std::span<const std::array<std::uint32_t, 2>> pieces,
                   std::span<const std::uint32_t> exposed) {
  if (!std::equal(exposed.begin(), exposed.end(),
                  points_.begin() + static_cast<std::ptrdiff_t>(whole_points_), points_.end())) {
    segments_.resize(whole_);
    points_.resize(whole_points_);
    std::fill(exposed_.begin(), exposed_.end(), 0);
    for (const std::uint32_t i : exposed) {
      segments_.push_back({.a = i, .b = i, .before = kNone, .after = kNone, .member = body_.member[i]});
      points_.push_back(i);
      exposed_[i] = 1;
    }
    built_at_.clear();
  }
  torn_.assign(segments_.size(), 0);
  for (std::size_t s = 0; s < segments_.size() && !pieces.empty(); ++s)
    torn_[s] = std::any_of(pieces.begin(), pieces.end(), [&](const std::array<std::uint32_t, 2>& piece) {
      return piece[0] == segments_[s].a && piece[1] == segments_[s].b;
    });
}

bool Pinball::stale(std::span<const double> position) const {
  if (built_at_.empty()) return true;
  const double limit = 0.25 * kAhead * kAhead * spacing_ * spacing_;
  const auto moved = [&](std::uint32_t i) {
    const double dx = position[2 * i] - built_at_[2 * i], dy = position[2 * i + 1] - built_at_[2 * i + 1];
    return !(dx * dx + dy * dy < limit);
  };
  return std::any_of(points_.begin(), points_.end(), moved);
}

// Pieces of surfaces by the cell of their middle; a point looks into the nine cells round its own.
void Pinball::find_candidates(std::span<const double> x) {
  built_at_.assign(x.begin(), x.end());
  candidate_.clear();
  if (segments_.empty()) return;
  double longest = 0, thickest = 0, low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300};
  for (const ContactMember& member : settings_.members)
    thickest = std::max(thickest, member.half_thickness + member.radius);
  std::vector<std::array<double, 2>> middle(segments_.size());
  for (std::size_t s = 0; s < segments_.size(); ++s) {
    const double *a = &x[2 * segments_[s].a], *b = &x[2 * segments_[s].b];
    longest = std::max(longest, std::hypot(b[0] - a[0], b[1] - a[1]));
    for (std::size_t c = 0; c < 2; ++c) {
      middle[s][c] = 0.5 * (a[c] + b[c]);
      low[c] = std::min(low[c], middle[s][c]);
      high[c] = std::max(high[c], middle[s][c]);
    }
  }
  const bool meets_balls = settings_.normals == ContactNormals::centre_line || points_.size() > whole_points_;
  const double balls = meets_balls ? spacing_ : 0;
  const double reach = (kNearBy + kAhead) * spacing_ + thickest + balls + 0.5 * longest;
  double cell = reach;
  while (((high[0] - low[0]) / cell + 1) * ((high[1] - low[1]) / cell + 1) > 1e6) cell *= 1.5;
  const auto columns = static_cast<std::int64_t>((high[0] - low[0]) / cell) + 1,
             rows = static_cast<std::int64_t>((high[1] - low[1]) / cell) + 1;
  cell_first_.assign(static_cast<std::size_t>(columns * rows) + 1, 0);
  std::vector<std::uint32_t> cell_of(segments_.size());
  for (std::size_t s = 0; s < segments_.size(); ++s) {
    const auto column = static_cast<std::int64_t>((middle[s][0] - low[0]) / cell),
               row = static_cast<std::int64_t>((middle[s][1] - low[1]) / cell);
    cell_of[s] = static_cast<std::uint32_t>(row * columns + column);
    ++cell_first_[cell_of[s] + 1];
  }
  for (std::size_t c = 0; c + 1 < cell_first_.size(); ++c) cell_first_[c + 1] += cell_first_[c];
  cell_segment_.resize(segments_.size());
  std::vector<std::uint32_t> next(cell_first_.begin(), cell_first_.end() - 1);
  for (std::uint32_t s = 0; s < segments_.size(); ++s) cell_segment_[next[cell_of[s]]++] = s;
  for (const std::uint32_t i : points_) {
    const double px = x[2 * i], py = x[2 * i + 1];
    if (!(px > low[0] - reach && px < high[0] + reach && py > low[1] - reach && py < high[1] + reach))
      continue;
    const ContactMember& own = settings_.members[body_.member[i]];
    const auto column = static_cast<std::int64_t>(std::floor((px - low[0]) / cell)),
               row = static_cast<std::int64_t>(std::floor((py - low[1]) / cell));
    for (std::int64_t r = std::max<std::int64_t>(0, row - 1); r < std::min(rows, row + 2); ++r)
      for (std::int64_t c = std::max<std::int64_t>(0, column - 1); c < std::min(columns, column + 2); ++c) {
        const auto at = static_cast<std::size_t>(r * columns + c);
        for (std::uint32_t k = cell_first_[at]; k < cell_first_[at + 1]; ++k) {
          const std::uint32_t s = cell_segment_[k];
          const std::size_t other = segments_[s].member;
          if (other == body_.member[i] || !(settings_.members[other].hardness > own.hardness)) continue;
          const double dx = middle[s][0] - px, dy = middle[s][1] - py;
          if (dx * dx + dy * dy < reach * reach) candidate_.push_back({i, s});
        }
      }
  }
}

std::array<double, 2> Pinball::arms(std::uint32_t point, const Segment& segment, double reach) const {
  const auto half = [&](std::size_t member) {
    return settings_.members[member].two_sided ? settings_.members[member].half_thickness : 0.0;
  };
  double on_point = half(body_.member[point]), on_surface = half(segment.member);
  const double shells = on_point + on_surface, rest = reach - shells;
  if (rigid_of_[segment.a] != kNone) return {on_point, on_surface + rest};
  if (rigid_of_[point] != kNone) return {on_point + rest, on_surface};
  if (!(shells > 0)) return {0, 0};
  return {on_point * reach / shells, on_surface * reach / shells};
}

void Pinball::attach(ContactRow& row, std::uint32_t particle, double weight, double nx, double ny, double arm,
                     std::span<const double> x) const {
  const double tx = -ny, ty = nx;
  const std::uint32_t r = rigid_of_[particle];
  if (r == kNone) {
    row.add(2 * particle, weight * nx, weight * tx);
    row.add(2 * particle + 1, weight * ny, weight * ty);
    if (!turns_.empty() && turns_[particle] != kNone)
      row.add(static_cast<std::uint32_t>(2 * body_.size() + 3 * body_.rigid.size()) + turns_[particle], 0,
              weight * arm);
    return;
  }
  const RigidBody& rigid = body_.rigid[r];
  const double rx = x[2 * particle] - rigid.centre[0] - rigid_[6 * r],
               ry = x[2 * particle + 1] - rigid.centre[1] - rigid_[6 * r + 1];
  const auto first = static_cast<std::uint32_t>(2 * body_.size() + 3 * r);
  row.add(first, weight * nx, weight * tx);
  row.add(first + 1, weight * ny, weight * ty);
  row.add(first + 2, weight * (rx * ny - ry * nx), weight * (rx * ty - ry * tx + arm));
}

void Pinball::add_row(std::uint32_t point, const Segment& segment, double share, double nx, double ny,
                      double reach, double gap, std::span<const double> x) {
  share = std::clamp(share, 0.0, 1.0);
  // At the joint of two pieces both say the same.
  for (std::size_t k = rows_.size(); k-- > 0 && rows_[k].point == point;)
    if (rows_[k].surface_member == segment.member &&
        rows_[k].direction[0] * nx + rows_[k].direction[1] * ny > kSame)
      return;
  ContactRow& row = rows_.emplace_back();
  row.point = point;
  row.gap = gap;
  row.direction = {nx, ny};
  row.point_member = body_.member[point];
  row.surface_member = segment.member;
  row.floor = gap > 0 ? -gap / time_step_ : -settings_.penetration_correction * gap / time_step_;
  const auto [on_point, on_surface] = arms(point, segment, reach);
  attach(row, point, 1, nx, ny, -on_point, x);
  if (share < 1) attach(row, segment.a, share - 1, nx, ny, on_surface, x);
  if (share > 0) attach(row, segment.b, -share, nx, ny, on_surface, x);
  if (settings_.friction) reach_out(row, segment, reach - on_point - on_surface, x);
}

// As if the piece were rigid: where it reaches to, its turning moves too.
void Pinball::reach_out(ContactRow& row, const Segment& segment, double arm, std::span<const double> x) {
  if (segment.a == segment.b || rigid_of_[segment.a] != kNone || arm == 0) return;
  const double *a = &x[2 * segment.a], *b = &x[2 * segment.b];
  const double ex = b[0] - a[0], ey = b[1] - a[1], l2 = ex * ex + ey * ey;
  if (!(l2 > 0)) return;
  for (std::uint32_t c = 0; c < 2; ++c) {
    const double turn = (c == 0 ? -ey : ex) * arm / l2;
    row.add_tangent(2 * segment.a + c, turn);
    row.add_tangent(2 * segment.b + c, -turn);
  }
}

// Against the pieces of one or several surfaces, each along its own normal.
void Pinball::meet(std::uint32_t point, std::size_t begin, std::size_t end, std::span<const double> x) {
  const double px = x[2 * point], py = x[2 * point + 1];
  const double radius = radius_of(point);
  // Rows behind a face, and the least deep of each body.
  struct Behind {
    std::size_t candidate;
    double height, share, nx, ny;
  };
  std::array<Behind, 16> behind;
  std::size_t count = 0;
  // Faces the point is in front of: behind another one of the same body that looks the other way and is
  // farther off it is not inside, but on the far side of something thin.
  struct Front {
    std::uint8_t member;
    double height, nx, ny;
  };
  std::array<Front, 16> front;
  std::size_t fronts = 0;
  const auto ball = [&](const Segment& segment) {
    const double dx = px - x[2 * segment.a], dy = py - x[2 * segment.a + 1], distance = std::hypot(dx, dy),
                 gap = distance - 0.5 * spacing_ - radius;
    if (distance > 0 && gap < kNearBy * spacing_)
      add_row(point, segment, 0, dx / distance, dy / distance, distance, gap, x);
  };
  for (std::size_t k = begin; k < end; ++k) {
    if (torn_[candidate_[k].segment] != 0) continue;
    const Segment& segment = segments_[candidate_[k].segment];
    if (segment.a == segment.b) {
      ball(segment);
      continue;
    }
    const ContactMember& surface = settings_.members[segment.member];
    const double offset = surface.half_thickness + radius;
    const double *a = &x[2 * segment.a], *b = &x[2 * segment.b];
    const double tx = b[0] - a[0], ty = b[1] - a[1], l2 = tx * tx + ty * ty;
    if (!(l2 > 0)) continue;
    const double l = std::sqrt(l2), nx = -ty / l, ny = tx / l;
    const double t = ((px - a[0]) * tx + (py - a[1]) * ty) / l2;
    if (t >= -kHair && t < 1 + kHair) {
      const double height = (px - a[0]) * nx + (py - a[1]) * ny;
      if (surface.two_sided) {
        const double side = height < 0 ? -1 : 1;
        if (side * height - offset < kNearBy * spacing_)
          add_row(point, segment, t, side * nx, side * ny, side * height, side * height - offset, x);
      } else if (height >= 0) {
        if (fronts < front.size()) front[fronts++] = {segment.member, height, nx, ny};
        if (height - offset < kNearBy * spacing_)
          add_row(point, segment, t, nx, ny, height, height - offset, x);
      } else if (height > -kDeepestBall * spacing_ && count < behind.size()) {
        behind[count++] = {k, height, t, nx, ny};
      }
      continue;
    }
    // A corner: the point is beyond the end of both of its pieces.
    const bool at_start = t < 0;
    std::uint32_t other = at_start ? segment.before : segment.after;
    if (other != kNone && torn_[other] != 0) other = kNone;
    double ox = 0, oy = 0;
    if (other != kNone) {
      const Segment& piece = segments_[other];
      const double *c = &x[2 * piece.a], *d = &x[2 * piece.b];
      const double ux = d[0] - c[0], uy = d[1] - c[1], m2 = ux * ux + uy * uy;
      if (!(m2 > 0)) continue;
      const double s = ((px - c[0]) * ux + (py - c[1]) * uy) / m2;
      // Each corner is seen from the piece that starts there.
      if (!at_start || s < 1 + kHair) continue;
      const double m = std::sqrt(m2);
      ox = -uy / m;
      oy = ux / m;
    }
    const double* corner = at_start ? a : b;
    const double dx = px - corner[0], dy = py - corner[1], distance = std::hypot(dx, dy);
    if (!(distance > 0) || distance - offset > kNearBy * spacing_) continue;
    if (!surface.two_sided && dx * (nx + ox) + dy * (ny + oy) < 0) continue;
    add_row(point, segment, at_start ? 0.0 : 1.0, dx / distance, dy / distance, distance, distance - offset,
            x);
  }
  for (std::size_t e = 0; e < count; ++e) {
    const Segment& segment = segments_[candidate_[behind[e].candidate].segment];
    if (std::any_of(front.begin(), front.begin() + static_cast<std::ptrdiff_t>(fronts),
                    [&](const Front& face) {
                      return face.member == segment.member && face.height < -behind[e].height &&
                             face.nx * behind[e].nx + face.ny * behind[e].ny < kBack;
                    }))
      continue;
    bool nearest = true;
    for (std::size_t o = 0; o < count; ++o)
      if (segments_[candidate_[behind[o].candidate].segment].member == segment.member &&
          (behind[o].height > behind[e].height || (behind[o].height == behind[e].height && o < e)))
        nearest = false;
    if (!nearest && behind[e].height < -kBehind * spacing_) continue;
    const double offset = settings_.members[segment.member].half_thickness + radius;
    add_row(point, segment, behind[e].share, behind[e].nx, behind[e].ny, behind[e].height,
            behind[e].height - offset, x);
  }
}

// Ball against ball along the line of centres; both have half a spacing, or half the thickness of a shell.
void Pinball::meet_balls(std::uint32_t point, std::size_t begin, std::size_t end, std::span<const double> x) {
  const auto radius = [&](const ContactMember& member) {
    return member.two_sided ? member.half_thickness : 0.5 * spacing_;
  };
  for (std::size_t k = begin; k < end; ++k) {
    const Segment& segment = segments_[candidate_[k].segment];
    const double sum =
        radius(settings_.members[segment.member]) + radius(settings_.members[body_.member[point]]);
    const auto ball = [&](std::uint32_t other, double share) {
      const double dx = x[2 * point] - x[2 * other], dy = x[2 * point + 1] - x[2 * other + 1],
                   distance = std::hypot(dx, dy);
      if (distance > 0 && distance - sum < kNearBy * spacing_)
        add_row(point, segment, share, dx / distance, dy / distance, distance, distance - sum, x);
    };
    ball(segment.a, 0);
    if (segment.after == kNone) ball(segment.b, 1);
  }
}

const std::vector<ContactRow>& Pinball::find(std::span<const double> position, std::span<const double> rigid,
                                             double time_step) {
  rigid_ = rigid;
  time_step_ = time_step;
  rows_.clear();
  if (stale(position)) find_candidates(position);
  for (std::size_t k = 0; k < candidate_.size();) {
    std::size_t end = k + 1;
    while (end < candidate_.size() && candidate_[end].point == candidate_[k].point) ++end;
    if (!left_out_.empty() && left_out_[candidate_[k].point] != 0) {
      k = end;
      continue;
    }
    if (settings_.normals == ContactNormals::centre_line)
      meet_balls(candidate_[k].point, k, end, position);
    else
      meet(candidate_[k].point, k, end, position);
    k = end;
  }
  return rows_;
}

}  // namespace estuary::solid
