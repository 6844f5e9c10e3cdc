#include "shell_row.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "on_team.hpp"

namespace estuary::solid {
namespace {

using Vector = std::array<double, 2>;

Vector normal_of(double angle) {
  return {std::cos(angle), std::sin(angle)};
}
double inner(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1];
}

}  // namespace

ShellRow::ShellRow(const Body& body, std::vector<ShellSection> sections)
    : body_(body), sections_(std::move(sections)), local_(body.size(), kNone) {
  for (std::size_t i = 0; i < body.particles(); ++i)
    if (sections_[body.member[i]].thickness > 0) {
      local_[i] = static_cast<std::uint32_t>(particle_.size());
      particle_.push_back(static_cast<std::uint32_t>(i));
    }
  const std::size_t n = size();
  before_.assign(n, kNone);
  after_.assign(n, kNone);
  fibre_angle_.resize(n);
  inertia_.assign(n, 0.0);
  moment_.assign(n, 0.0);
  for (const ShellSection& section : sections_) {
    if (!(section.thickness > 0)) continue;
    breakable_ = breakable_ || section.rupture.any();
    remembers_ = remembers_ || section.plastic() || section.rupture.any();
    viscous_ = viscous_ || section.viscosity.any();
    quadratic_ = quadratic_ || section.viscosity.quadratic > 0;
    filters_ = filters_ || section.viscosity.normal_filter > 0;
  }
  if (viscous_) rate_.assign(n, 0.0);
  if (filters_) filtered_.assign(n, 0.0);
  for (std::size_t o = 0; o < body.outlines.size(); ++o) {
    const Outline& outline = body.outlines[o];
    const ShellSection& section = sections_[body.outline_member[o]];
    if (!(section.thickness > 0)) continue;
    const std::size_t count = outline.particle.size();
    for (std::size_t k = 0; k < (outline.closed ? count : count - 1); ++k) {
      Link link{};
      const std::uint32_t i = outline.particle[k], j = outline.particle[(k + 1) % count];
      link.a = local_[i];
      link.b = local_[j];
      const double dx = body.position[2 * j] - body.position[2 * i],
                   dy = body.position[2 * j + 1] - body.position[2 * i + 1];
      link.length = std::hypot(dx, dy);
      link.tangent = {dx / link.length, dy / link.length};
      link.membrane = section.membrane();
      link.shear = section.shear();
      link.bending = section.bending();
      link.member = body.outline_member[o];
      after_[link.a] = before_[link.b] = static_cast<std::uint32_t>(links_.size());
      links_.push_back(link);
    }
  }
  // The fibre at a particle is normal to the mean of its links' directions.
  for (std::size_t i = 0; i < n; ++i) {
    Vector t{};
    const ShellSection& section = sections_[body.member[particle_[i]]];
    for (const std::uint32_t l : {before_[i], after_[i]}) {
      if (l == kNone) continue;
      for (std::size_t c = 0; c < 2; ++c) t[c] += links_[l].tangent[c];
      inertia_[i] += 0.5 * links_[l].length * section.density * std::pow(section.thickness, 3) / 12;
    }
    fibre_angle_[i] = std::atan2(t[0], -t[1]);
    rest_fibre_.push_back(normal_of(fibre_angle_[i]));
  }
  at_.resize(links_.size());
  fibre_ = rest_fibre_;
}

std::vector<double> ShellRow::rest_history() const {
  return std::vector<double>(2 * size() + (remembers_ ? kLinkHistory * links_.size() : 0), 0.0);
}

void ShellRow::pull(std::span<const double> displacement, std::span<double> history, bool commit,
                    std::size_t l, std::span<const double> velocity) {
  const Link& link = links_[l];
  LinkState& now = at_[l];
  const std::size_t pa = particle_[link.a], pb = particle_[link.b];
  Vector x{};
  for (std::size_t c = 0; c < 2; ++c)
    x[c] = link.tangent[c] + (displacement[2 * pb + c] - displacement[2 * pa + c]) / link.length;
  const double turned = 0.5 * (history[2 * link.a] + history[2 * link.b]), cosine = std::cos(turned),
               sine = std::sin(turned);
  Strain strain{};
  strain.tangent = {cosine * link.tangent[0] - sine * link.tangent[1],
                    sine * link.tangent[0] + cosine * link.tangent[1]};
  strain.normal = {-strain.tangent[1], strain.tangent[0]};
  strain.along = inner(x, strain.tangent);
  strain.shear = inner(x, strain.normal);
  strain.curvature = (history[2 * link.a] - history[2 * link.b]) / link.length;
  const double stretch = std::sqrt(inner(x, x));
  if (broken(history, l)) {
    now = LinkState{};
    now.stretch = stretch;
    now.shear_strain = strain.shear;
    return;
  }
  now.whole = true;
  now.folded = strain.along <= kFolded;  // what is not a number is found by the forces
  now.stretch = stretch;
  now.along = strain.along;
  now.shear_strain = strain.shear;
  const ShellSection& section = sections_[link.member];
  SectionVector all{};
  if (section.plastic()) {
    double* own = &history[2 * size() + kLinkHistory * l];
    // The membrane strain is ln(x'.t): what does work on it is the force along times x'.t.
    const double along = std::max(strain.along, kFolded);
    const SectionAnswer answer =
        flow(section, {std::log(along), strain.shear, strain.curvature}, own, commit ? own : nullptr);
    all = answer.resultant;
    all.membrane /= along;
    now.stored = link.length * answer.stored;
    now.energy = now.stored + (commit ? 0 : link.length * answer.dissipated);
  } else {
    const double e = 0.5 * (strain.along * strain.along - 1);
    all = {link.membrane * e * strain.along, link.shear * strain.shear, link.bending * strain.curvature};
    now.energy = now.stored =
        0.5 * link.length *
        (link.membrane * e * e + all.shear * strain.shear + all.bending * strain.curvature);
  }
  now.normal_force = all.membrane;
  now.shear_force = all.shear;
  now.moment = all.bending;
  if (!velocity.empty()) {
    const SectionVector more = drag(l, velocity, strain);
    all.membrane += more.membrane;
    all.shear += more.shear;
    all.bending += more.bending;
  }
  for (std::size_t c = 0; c < 2; ++c)
    now.force[c] = all.membrane * strain.tangent[c] + all.shear * strain.normal[c];
  now.couple = couple(link, strain, all);
}

void ShellRow::gather(std::span<const double> displacement, std::size_t i, Fields& fields) {
  const std::size_t p = particle_[i];
  const Vector normal = fibre_[i];
  Vector force{};
  double moment = 0;
  if (after_[i] != kNone) {
    const LinkState& link = at_[after_[i]];
    for (std::size_t c = 0; c < 2; ++c) force[c] += link.force[c];
    moment += link.couple[0];
  }
  if (before_[i] != kNone) {
    const LinkState& link = at_[before_[i]];
    for (std::size_t c = 0; c < 2; ++c) force[c] -= link.force[c];
    moment += link.couple[1];
  }
  for (std::size_t c = 0; c < 2; ++c) fields.force[2 * p + c] += force[c];
  moment_[i] = moment;
  // The mid-line's direction and the fibre, from the reference's.
  const Vector rest = rest_fibre_[i];
  Vector x{};
  double links = 0;
  for (const std::uint32_t l : {before_[i], after_[i]}) {
    if (l == kNone) continue;
    const Link& link = links_[l];
    for (std::size_t c = 0; c < 2; ++c)
      x[c] +=
          link.tangent[c] +
          (displacement[2 * particle_[link.b] + c] - displacement[2 * particle_[link.a] + c]) / link.length;
    links += 1;
  }
  double* f = &fields.deformation_gradient[4 * p];
  for (std::size_t c = 0; c < 2; ++c) {
    // The reference direction is the fibre turned back by a quarter.
    f[2 * c] = x[c] / links * rest[1] + normal[c] * rest[0];
    f[2 * c + 1] = -x[c] / links * rest[0] + normal[c] * rest[1];
  }
}

std::int64_t ShellRow::evaluate(std::span<const double> displacement, std::span<double> history, bool commit,
                                Fields& fields, std::span<const double> velocity) {
  const std::size_t count = links_.size(), n = size();
  on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < n; ++i) fibre_[i] = normal_of(fibre_angle_[i] + history[2 * i]);
  });
  std::int64_t bad = 0, folded = 0;
  on_team(n > kSerialBelow, [&] {
    std::int64_t folded_here = 0;
#pragma omp for schedule(static) nowait
    for (std::size_t l = 0; l < count; ++l) {
      pull(displacement, history, commit, l, velocity);
      if (at_[l].folded) ++folded_here;
    }
#pragma omp atomic
    folded += folded_here;
  });
  folded_ = folded;
  on_team(n > kSerialBelow, [&] {
    std::int64_t bad_here = 0;
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < n; ++i) {
      gather(displacement, i, fields);
      const std::size_t p = particle_[i];
      if (!std::isfinite(fields.force[2 * p] + fields.force[2 * p + 1] + moment_[i])) ++bad_here;
    }
#pragma omp atomic
    bad += bad_here;
  });
  return bad;
}

double ShellRow::energy() const {
  double sum = 0;
  for (const LinkState& link : at_) sum += link.energy;
  return sum;
}

double ShellRow::plastic_work(std::span<const double> history) const {
  double sum = 0;
  for (std::size_t l = 0; remembers_ && l < links_.size(); ++l)
    sum += links_[l].length * memory(history, l)[5];
  return sum;
}

template <typename Work>
void ShellRow::visit_moments(const Loading& loading, double time, double fraction, const Work& work) const {
  for (const MomentLoad& load : loading.moments) {
    const double each =
        load.moment * (load.factor ? load.factor(time) : 1.0) / static_cast<double>(load.particle.size());
    for (const std::uint32_t i : load.particle) work(local_[i], each);
  }
  if (!loading.couples) return;
  for (std::size_t k = 0; k < loading.couples->particle.size(); ++k) {
    const std::uint32_t i = local_[loading.couples->particle[k]];
    const Vector& n = fibre_[i];
    work(i, n[0] * loading.couples->at(2 * k + 1, fraction) - n[1] * loading.couples->at(2 * k, fraction));
  }
}

void ShellRow::add_moments(const Loading& loading, double time, double fraction) {
  visit_moments(loading, time, fraction, [&](std::uint32_t i, double moment) { moment_[i] += moment; });
}

double ShellRow::moment_work(const Loading& loading, double time, double fraction, double dt,
                             std::span<const double> history) const {
  double sum = 0;
  visit_moments(loading, time, fraction,
                [&](std::uint32_t i, double moment) { sum += moment * history[2 * i + 1] * dt; });
  return sum;
}

double ShellRow::turning_work(const Loading& loading, double time, double fraction,
                              std::span<const double> angle) const {
  double sum = 0;
  visit_moments(loading, time, fraction, [&](std::uint32_t i, double moment) { sum += moment * angle[i]; });
  return sum;
}

std::array<std::array<double, 2>, 2> ShellRow::fibre_motion(std::uint32_t particle,
                                                            std::span<const double> history) const {
  const std::uint32_t i = local_[particle];
  const Vector now = normal_of(fibre_angle_[i] + history[2 * i]), rest = rest_fibre_[i];
  const double rate = history[2 * i + 1];
  return {{{now[0] - rest[0], now[1] - rest[1]}, {-rate * now[1], rate * now[0]}}};
}

void ShellRow::turn(std::span<double> history, double dt, double decay, double gain, bool ends) {
  const std::size_t n = size();
  on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < n; ++i) {
      if (!turns(i)) continue;
      const double kick = 0.5 * dt * moment_[i] / inertia_[i];
      double& rate = history[2 * i + 1];
      rate = ends ? gain * (rate + kick) : decay * rate + kick;
      if (!ends) history[2 * i] += dt * rate;
      if (viscous_) rate_[i] = ends ? rate : rate + kick;
    }
  });
}

double ShellRow::kinetic_energy(std::span<const double> history) const {
  double sum = 0;
  for (std::size_t i = 0; i < size(); ++i) sum += 0.5 * inertia_[i] * history[2 * i + 1] * history[2 * i + 1];
  return sum;
}

double ShellRow::spin(std::span<const double> history) const {
  double sum = 0;
  for (std::size_t i = 0; i < size(); ++i) sum += inertia_[i] * history[2 * i + 1];
  return sum;
}

double ShellRow::held_moment() const {
  double sum = 0;
  for (std::size_t i = 0; i < size(); ++i)
    if (!turns(i)) sum -= moment_[i];
  return sum;
}

Tensor<double> ShellRow::first_piola_kirchhoff_at(std::size_t i) const {
  const double h = sections_[body_.member[particle_[i]]].thickness;
  const Vector rest = rest_fibre_[i];
  Vector stress{};
  double links = 0;
  for (const std::uint32_t l : {before_[i], after_[i]}) {
    if (l == kNone) continue;
    for (std::size_t c = 0; c < 2; ++c) stress[c] += at_[l].force[c] / h;
    links += 1;
  }
  const Vector t{rest[1] / links, -rest[0] / links};
  return {stress[0] * t[0], stress[0] * t[1], stress[1] * t[0], stress[1] * t[1]};
}

std::array<double, 4> ShellRow::section_at(std::size_t i, std::span<const double> history) const {
  std::array<double, 4> value{};
  double links = 0;
  for (const std::uint32_t l : {before_[i], after_[i]}) {
    if (l == kNone) continue;
    value[0] += at_[l].normal_force;
    value[1] += at_[l].shear_force;
    value[2] += at_[l].moment;
    if (remembers_) value[3] += memory(history, l)[3];
    links += 1;
  }
  for (double& v : value) v /= links;
  return value;
}

void ShellRow::relaxation_masses(std::vector<double>& mass, std::vector<double>& inertia) const {
  mass.assign(size(), 0.0);
  inertia.assign(size(), 0.0);
  for (const Link& link : links_)
    for (const std::uint32_t i : {link.a, link.b}) {
      mass[i] += 0.25 * (2 * link.membrane + 3 * link.shear) / link.length;
      inertia[i] += 0.25 * (1.5 * link.shear * link.length + 2 * link.bending / link.length);
    }
}

double ShellRow::round_off() const {
  double sum = 0;
  for (const Link& link : links_) sum += link.membrane * link.membrane;
  return 4 * std::numeric_limits<double>::epsilon() * std::sqrt(sum);
}

}  // namespace estuary::solid
