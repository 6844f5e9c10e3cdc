#include "rupture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "internal_force.hpp"
#include "on_team.hpp"
#include "tensor.hpp"

namespace estuary::solid {
namespace {

// A moment of links weaker than this share of the whole one's, in its weaker direction, makes no gradient.
constexpr double kLeastMoment = 0.2;
// The first whole link ahead of a crack that is about to grow counts as kTip / (4 pi) spacings ahead of its
// tip: measured on a strip between grips.
constexpr double kTip = 5.14;
// C of a break beyond this is no deformation any more.
constexpr double kLargest = 50;

struct Moment {
  double xx = 0, xy = 0, yy = 0;
  [[nodiscard]] double mean() const { return 0.5 * (xx + yy); }
  [[nodiscard]] double spread() const { return std::hypot(0.5 * (xx - yy), xy); }
};

Tensor<double> base_at(const std::vector<double>& values, std::size_t i) {
  return {values[4 * i], values[4 * i + 1], values[4 * i + 2], values[4 * i + 3]};
}

// Whether two segments cross. What ends on the other, up to rounding, does not cross it: otherwise a crack
// along a row of particles would break the links that rounding picks.
bool cross(const std::array<double, 4>& a, const std::array<double, 4>& b) {
  const auto side = [](const std::array<double, 4>& line, double x, double y) {
    return (line[2] - line[0]) * (y - line[1]) - (line[3] - line[1]) * (x - line[0]);
  };
  const double least = 1e-6 * std::hypot(a[2] - a[0], a[3] - a[1]) * std::hypot(b[2] - b[0], b[3] - b[1]);
  const auto apart = [&](double p, double q) {
    return p * q < 0 && std::min(std::abs(p), std::abs(q)) > least;
  };
  return apart(side(a, b[0], b[1]), side(a, b[2], b[3])) && apart(side(b, a[0], a[1]), side(b, a[2], a[3]));
}

}  // namespace

Rupture::Rupture(const Body& body, Neighbourhood& pairs, std::vector<RuptureLimits> limits,
                 std::vector<double> moduli, std::vector<std::array<double, 4>> cracks, Kernel kernel)
    : body_(body),
      whole_body_(body),
      pairs_(pairs),
      whole_(pairs),
      limits_(std::move(limits)),
      moduli_(std::move(moduli)),
      cracks_(std::move(cracks)),
      isolated_(body.size(), 0),
      taken_(body.size(), 0),
      pending_(body.size(), 0) {
  mirror_.resize(pairs.pairs());
  for (std::size_t i = 0; i < body.size(); ++i)
    for (std::uint32_t k = pairs.first[i]; k < pairs.first[i + 1]; ++k) {
      const double r = std::hypot(pairs.offset[2 * k], pairs.offset[2 * k + 1]);
      length_.push_back(r);
      weight_.push_back(-kernel_slope(kernel, r, body.smoothing_length) / r);
      const std::uint32_t j = pairs.neighbour[k];
      for (std::uint32_t m = pairs.first[j]; m < pairs.first[j + 1]; ++m)
        if (pairs.neighbour[m] == i) mirror_[k] = m;
    }
  check_cracks();
  apply(rest_history());
  rest_steepness_.assign(limits_.size(), 0.0);
  for (std::size_t i = 0; i < body_.size(); ++i) {
    double& most = rest_steepness_[body_.member[i]];
    most = std::max(most, steepness(i));
  }
  steepening_ = 1;
}

// A crack that does nothing is a slip: a point outside, or a line right through particles.
void Rupture::check_cracks() const {
  for (const auto& crack : cracks_) {
    bool crosses = std::hypot(crack[2] - crack[0], crack[3] - crack[1]) < body_.mean_spacing();
    for (std::size_t i = 0; i < body_.size() && !crosses; ++i)
      for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1] && !crosses; ++k)
        crosses = cross(link(i, k), crack);
    if (!crosses)
      throw std::invalid_argument(fmt::format(
          "the crack from ({:.6g}, {:.6g}) to ({:.6g}, {:.6g}) breaks no link between particles: it lies "
          "outside of the body or right on a row of particles; lay it through the body between two rows, or "
          "change `spacing`",
          crack[0], crack[1], crack[2], crack[3]));
  }
}

std::array<double, 4> Rupture::link(std::size_t i, std::size_t k) const {
  const double x = body_.position[2 * i], y = body_.position[2 * i + 1];
  return {x, y, x + whole_.offset[2 * k], y + whole_.offset[2 * k + 1]};
}

std::vector<double> Rupture::rest_history() const {
  std::vector<double> history(whole_.pairs() + 4 * body_.size() + 1, 0.0);
  for (std::size_t i = 0; i < body_.size(); ++i)
    history[whole_.pairs() + 4 * i] = history[whole_.pairs() + 4 * i + 3] = 1;
  for (std::size_t i = 0; i < body_.size() && !cracks_.empty(); ++i)
    for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1]; ++k)
      if (std::any_of(cracks_.begin(), cracks_.end(),
                      [&](const auto& crack) { return cross(link(i, k), crack); }))
        history[k] = 1;
  return history;
}

double Rupture::steepness(std::size_t i) const {
  double x = 0, y = 0, sum = 0;
  for (std::uint32_t k = pairs_.first[i]; k < pairs_.first[i + 1]; ++k) {
    const double gx = pairs_.gradient[2 * k], gy = pairs_.gradient[2 * k + 1];
    sum += (gx * gx + gy * gy) / body_.mass[pairs_.neighbour[k]];
    x += gx;
    y += gy;
  }
  return body_.energy_volume[i] * (sum + (x * x + y * y) / body_.mass[i]);
}

std::optional<double> Rupture::fit(std::size_t i, std::span<const double> history) {
  Moment left, all;
  bool touched = false;
  for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1]; ++k) {
    const double x = whole_.offset[2 * k], y = whole_.offset[2 * k + 1], w = weight_[k];
    const auto add = [&](Moment& moment) {
      moment.xx += w * x * x;
      moment.xy += w * x * y;
      moment.yy += w * y * y;
    };
    add(all);
    if (intact(history, k))
      add(left);
    else
      touched = true;
  }
  if (!touched) return std::nullopt;
  const double weaker = left.mean() - left.spread(), stronger = left.mean() + left.spread(),
               whole_weaker = all.mean() - all.spread(), whole_stronger = all.mean() + all.spread();
  const bool carries = weaker > kLeastMoment * whole_stronger;
  const double determinant = left.xx * left.yy - left.xy * left.xy;
  for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1]; ++k) {
    const double x = whole_.offset[2 * k], y = whole_.offset[2 * k + 1],
                 w = carries && intact(history, k) ? weight_[k] / determinant : 0;
    pairs_.gradient[2 * k] = w * (left.yy * x - left.xy * y);
    pairs_.gradient[2 * k + 1] = w * (left.xx * y - left.xy * x);
  }
  if (!carries) return 0;
  // At a corner both directions have lost.
  const double along = stronger / whole_stronger;
  return std::min(1.0, weaker / whole_weaker * (along < 0.7 ? along : 1.0));
}

void Rupture::apply(std::span<const double> history) {
  const std::size_t n = body_.size();
  pairs_ = whole_;
  body_.energy_volume = whole_body_.energy_volume;
  std::fill(isolated_.begin(), isolated_.end(), 0);
  steepening_ = 1;
  base_.assign(history.begin() + static_cast<std::ptrdiff_t>(whole_.pairs()), history.end() - 1);
  const bool springs = !whole_.spring.empty();
  for (std::size_t i = 0; i < n; ++i) {
    const std::optional<double> share = fit(i, history);
    if (!share) continue;
    isolated_[i] = *share > 0 ? 0 : 1;
    body_.energy_volume[i] *= *share;
    const Tensor<double> c = base_at(base_, i);
    const bool turned = c.xx != 1 || c.xy != 0 || c.yx != 0 || c.yy != 1;
    pairs_.gradient_sum[2 * i] = pairs_.gradient_sum[2 * i + 1] = 0;
    for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1]; ++k) {
      double &x = pairs_.gradient[2 * k], &y = pairs_.gradient[2 * k + 1];
      const double gx = x, gy = y;
      x = gx * c.xx + gy * c.yx;
      y = gx * c.xy + gy * c.yy;
      pairs_.gradient_sum[2 * i] += x;
      pairs_.gradient_sum[2 * i + 1] += y;
      pairs_.reverse_gradient[2 * mirror_[k]] = x;
      pairs_.reverse_gradient[2 * mirror_[k] + 1] = y;
      // Deviations from a gradient that does not begin at rest mean nothing.
      const bool gone = !intact(history, k);
      if (springs && (gone || turned || isolated_[i] != 0)) pairs_.spring[k] = pairs_.spring[mirror_[k]] = 0;
      if (!pairs_.viscous_weight.empty() && gone)
        pairs_.viscous_weight[k] = pairs_.viscous_weight[mirror_[k]] = 0;
    }
    if (!rest_steepness_.empty())
      steepening_ = std::max(steepening_, steepness(i) / rest_steepness_[body_.member[i]]);
  }
  if (springs)
    for (std::size_t i = 0; i < n; ++i) {
      double moment[3] = {0, 0, 0};
      for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1]; ++k) {
        const double x = whole_.offset[2 * k], y = whole_.offset[2 * k + 1];
        moment[0] += pairs_.spring[k] * x * x;
        moment[1] += pairs_.spring[k] * x * y;
        moment[2] += pairs_.spring[k] * y * y;
      }
      std::copy(moment, moment + 3, pairs_.spring_moment.begin() + 3 * static_cast<std::ptrdiff_t>(i));
    }
  applied_.assign(history.begin(), history.end());
}

void Rupture::restore(std::span<const double> history) {
  if (!std::equal(history.begin(), history.end() - 1, applied_.begin())) apply(history);
}

double Rupture::traction_energy(std::size_t k, std::size_t i, std::span<const double> stress) const {
  const double x = whole_.offset[2 * k], y = whole_.offset[2 * k + 1], r = length_[k];
  double t[2] = {0, 0};
  int ends = 0;
  for (const std::size_t end : {i, std::size_t{whole_.neighbour[k]}}) {
    const double volume = body_.energy_volume[end];
    if (isolated_[end] != 0 || !(volume > 0)) continue;
    for (std::size_t c = 0; c < 2; ++c)
      t[c] += (stress[4 * end + 2 * c] * x + stress[4 * end + 2 * c + 1] * y) / (volume * r);
    ++ends;
  }
  if (ends == 0) return 0;
  // A closed crack has no K_I: what presses across the link opens nothing.
  const double pull = std::max(0.0, (t[0] * x + t[1] * y) / r), slide = (t[1] * x - t[0] * y) / r;
  return 0.5 * (pull * pull + slide * slide) / (ends * ends * moduli_[body_.member[i]]);
}

bool Rupture::cut_crossing(std::size_t i, std::span<double> history) {
  bool cut = false;
  for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1]; ++k) {
    if (!intact(history, k)) continue;
    const std::uint32_t j = whole_.neighbour[k];
    const double shorter = (1 - 1e-6) * length_[k];
    int ways = 0, open = 0;
    for (std::uint32_t a = whole_.first[i]; a < whole_.first[i + 1]; ++a) {
      if (!(length_[a] < shorter)) continue;
      const std::uint32_t over = whole_.neighbour[a];
      for (std::uint32_t b = whole_.first[over]; b < whole_.first[over + 1]; ++b) {
        if (whole_.neighbour[b] != j || !(length_[b] < shorter)) continue;
        ++ways;
        if (intact(history, a) && intact(history, b)) ++open;
      }
    }
    // One way alone, as along a side, may end beside the crack.
    if (ways < 2 || open > 0) continue;
    history[k] = history[mirror_[k]] = 1;
    touch(static_cast<std::uint32_t>(i));
    touch(j);
    cut = true;
  }
  return cut;
}

double Rupture::overload(std::size_t k, std::size_t i, std::span<const double> u, const Loads& loads) const {
  const std::size_t j = whole_.neighbour[k];
  const RuptureLimits& limit = limits_[body_.member[i]];
  const double x = whole_.offset[2 * k], y = whole_.offset[2 * k + 1];
  const double stretch =
      std::hypot(x + u[2 * j] - u[2 * i], y + u[2 * j + 1] - u[2 * i + 1]) / length_[k] - 1;
  // What is pressed together does not part.
  if (!(stretch > 0)) return 0;
  const auto both = [&](std::size_t entry) {
    return loads.law_size > 0 ? loads.law[loads.law_size * i + entry] + loads.law[loads.law_size * j + entry]
                              : 0;
  };
  double worst = 0;
  if (limit.stretch > 0) worst = stretch / limit.stretch;
  if (limit.plastic_strain > 0) worst = std::max(worst, 0.5 * both(4) / limit.plastic_strain);
  if (limit.energy > 0) {
    const double density = kTip * traction_energy(k, i, loads.stress) + both(loads.law_size - 1);
    worst = std::max(worst, density * body_.mean_spacing() / limit.energy);
  }
  // Of links equally loaded the one that is stretched most.
  return worst > 1 ? worst + stretch : 0;
}

bool Rupture::find_overloaded(std::span<const double> u, const Loads& loads,
                              std::span<const double> history) {
  const std::size_t n = body_.size();
  // Blocks that do not depend on the threads, put together in their order.
  on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t b = 0; b < found_.size(); ++b) {
      found_[b].clear();
      for (std::size_t i = b * n / found_.size(); i < (b + 1) * n / found_.size(); ++i) {
        if (!limits_[body_.member[i]].any()) continue;
        for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1]; ++k) {
          const std::uint32_t j = whole_.neighbour[k];
          if (j <= i || !intact(history, k) || (isolated_[i] != 0 && isolated_[j] != 0)) continue;
          const double value = overload(k, i, u, loads);
          if (value > 0) found_[b].push_back({value, k, static_cast<std::uint32_t>(i), j});
        }
      }
    }
  });
  candidates_.clear();
  for (const auto& block : found_) candidates_.insert(candidates_.end(), block.begin(), block.end());
  return !candidates_.empty();
}

bool Rupture::find_hanging(std::span<const double> history) {
  candidates_.clear();
  for (std::uint32_t i = 0; i < body_.size(); ++i) {
    if (isolated_[i] == 0) continue;
    std::uint32_t last = 0, links = 0;
    for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1]; ++k) {
      if (!intact(history, k)) continue;
      last = k;
      ++links;
    }
    if (links == 1) candidates_.push_back({1, last, i, whole_.neighbour[last]});
  }
  return !candidates_.empty();
}

std::span<const std::uint32_t> Rupture::break_links(std::span<const double> u,
                                                    const std::vector<double>& deformation, bool plastic,
                                                    std::span<double> history) {
  std::sort(candidates_.begin(), candidates_.end(), [](const Candidate& a, const Candidate& b) {
    return a.overload != b.overload ? a.overload > b.overload : a.pair < b.pair;
  });
  std::fill(taken_.begin(), taken_.end(), 0);
  touched_.clear();
  unloaded_.clear();
  for (const Candidate& candidate : candidates_) {
    if (taken_[candidate.i] != 0 || taken_[candidate.j] != 0) continue;
    taken_[candidate.i] = taken_[candidate.j] = 1;
    touch(candidate.i);
    touch(candidate.j);
    history[candidate.pair] = history[mirror_[candidate.pair]] = 1;
  }
  // Until nothing changes, so that it does not matter who comes first: a longest link may hang on ones that
  // are cut here.
  for (bool cut = true; cut;) {
    cut = false;
    for (std::size_t t = 0, broken = touched_.size(); t < broken; ++t) {
      const std::uint32_t i = touched_[t];
      cut = cut_crossing(i, history) || cut;
      for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1]; ++k)
        cut = cut_crossing(whole_.neighbour[k], history) || cut;
    }
  }
  // Grows while it is worked off: whoever loses a link is fitted (again) afterwards.
  for (std::size_t t = 0; t < touched_.size(); ++t) {
    const std::uint32_t i = touched_[t];
    pending_[i] = 0;
    const std::span<double> own = history.subspan(whole_.pairs() + 4 * i, 4);
    const auto set = [&](const Tensor<double>& c) {
      own[0] = c.xx;
      own[1] = c.xy;
      own[2] = c.yx;
      own[3] = c.yy;
    };
    const bool carries = fit(i, history).value_or(1) > 0;
    if (!carries) unloaded_.push_back(i);
    set({1, 0, 0, 1});
    if (!carries || !plastic) continue;
    Tensor<double> f{1, 0, 0, 1};
    for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1]; ++k) {
      const std::size_t j = whole_.neighbour[k];
      const double dx = u[2 * j] - u[2 * i], dy = u[2 * j + 1] - u[2 * i + 1];
      f.xx += dx * pairs_.gradient[2 * k];
      f.xy += dx * pairs_.gradient[2 * k + 1];
      f.yx += dy * pairs_.gradient[2 * k];
      f.yy += dy * pairs_.gradient[2 * k + 1];
    }
    const double j = determinant(f);
    const Tensor<double> old = base_at(deformation, i);
    const Tensor<double> inverse{f.yy / j, -f.xy / j, -f.yx / j, f.xx / j};
    const Tensor<double> c = product(inverse, old);
    const double size = std::abs(c.xx) + std::abs(c.xy) + std::abs(c.yx) + std::abs(c.yy);
    if (j > 0 && size < kLargest) {
      set(c);
      continue;
    }
    // Links that are left say nothing sensible: cut them too.
    for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1]; ++k) {
      if (!intact(history, k)) continue;
      history[k] = history[mirror_[k]] = 1;
      touch(whole_.neighbour[k]);
    }
    unloaded_.push_back(i);
  }
  apply(history);
  return unloaded_;
}

std::vector<std::uint32_t> Rupture::isolated(std::span<const double> history) const {
  std::vector<std::uint32_t> result;
  for (std::uint32_t i = 0; i < body_.size(); ++i) {
    bool alone = isolated_[i] != 0;
    for (std::uint32_t k = whole_.first[i]; k < whole_.first[i + 1] && alone; ++k)
      alone = !intact(history, k);
    if (alone) result.push_back(i);
  }
  return result;
}

TornContours Rupture::torn_contours(std::span<const double> history) const {
  TornContours torn;
  std::vector<std::uint8_t> inside(body_.size(), 1);
  for (const Outline& outline : whole_body_.outlines) {
    const std::size_t n = outline.particle.size();
    for (std::size_t k = 0; k < n; ++k) {
      const std::uint32_t a = outline.particle[k], b = outline.particle[(k + 1) % n];
      inside[a] = 0;
      if (k + 1 == n && !outline.closed) continue;
      for (std::uint32_t m = whole_.first[a]; m < whole_.first[a + 1]; ++m)
        if (whole_.neighbour[m] == b && !intact(history, m)) torn.pieces.push_back({a, b});
    }
  }
  for (std::uint32_t i = 0; i < body_.size(); ++i) {
    if (inside[i] == 0) continue;
    bool lost = false;
    for (std::uint32_t m = whole_.first[i]; m < whole_.first[i + 1] && !lost; ++m) lost = !intact(history, m);
    if (lost) torn.exposed.push_back(i);
  }
  return torn;
}

std::array<double, 3> Rupture::losses(std::span<const double> history) const {
  std::array<double, 3> result{};
  for (std::size_t k = 0; k < whole_.pairs(); ++k)
    if (!intact(history, k)) result[0] += 0.5;
  for (std::size_t i = 0; i < body_.size(); ++i)
    if (isolated_[i] != 0) {
      result[1] += 1;
      result[2] += body_.mass[i];
    }
  return result;
}

}  // namespace estuary::solid
