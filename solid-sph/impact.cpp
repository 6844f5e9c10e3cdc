// The parts of an impact, what is stored in them and what is watched; how they move: impact_motion.cpp.
#include "impact.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace estuary::solid {
namespace {

// Shares of the bounds on the step that the methods themselves give.
constexpr double kFluidShare = 0.9;
constexpr double kSolidShare = 1.0;
// Nothing moves by more of a spacing in a step: contact looks no further ahead.
constexpr double kFarthest = 0.2;

std::vector<std::uint32_t> particles_that(const Body& body, const std::function<bool(std::size_t)>& chosen) {
  std::vector<std::uint32_t> result;
  for (std::uint32_t i = 0; i < body.size(); ++i)
    if (chosen(i)) result.push_back(i);
  return result;
}

// The chosen particles as a body of their own, with the same numbers of members.
std::unique_ptr<Body> part_of(const Body& body, const std::vector<std::uint32_t>& chosen,
                              const std::vector<std::uint32_t>& local) {
  auto part = std::make_unique<Body>();
  part->spacing = body.spacing;
  part->smoothing_length = body.smoothing_length;
  for (const std::uint32_t i : chosen) {
    part->position.insert(part->position.end(), {body.position[2 * i], body.position[2 * i + 1]});
    part->volume.push_back(body.volume[i]);
    part->energy_volume.push_back(body.energy_volume[i]);
    part->mass.push_back(body.mass[i]);
    part->fixed.push_back(body.fixed[i]);
    part->edge.push_back(body.edge[i]);
    part->member.push_back(body.member[i]);
  }
  for (std::size_t o = 0; o < body.outlines.size(); ++o) {
    Outline outline = body.outlines[o];
    if (outline.particle.empty() || !std::binary_search(chosen.begin(), chosen.end(), outline.particle[0]))
      continue;
    for (std::uint32_t& i : outline.particle) i = local[i];
    part->outlines.push_back(std::move(outline));
    part->outline_member.push_back(body.outline_member[o]);
  }
  return part;
}

std::vector<double> masses_of(const Body& body, const std::vector<std::uint32_t>& particles) {
  std::vector<double> mass;
  mass.reserve(particles.size());
  for (const std::uint32_t i : particles) mass.push_back(body.mass[i]);
  return mass;
}

std::vector<std::uint8_t> members_of(const Body& body, const std::vector<std::uint32_t>& particles) {
  std::vector<std::uint8_t> member;
  member.reserve(particles.size());
  for (const std::uint32_t i : particles) member.push_back(body.member[i]);
  return member;
}

// Of every degree of freedom; 0 where it does not yield.
std::vector<double> inverse_masses(const Body& body, const std::array<bool, 2>& held,
                                   const ShellRow* turning) {
  std::vector<double> result(2 * body.size() + 3 * body.rigid.size(), 0.0);
  for (std::size_t c = 0; c < 2 * body.size(); ++c)
    if (!body.holds(c / 2, c % 2) && !held[c % 2] && body.mass[c / 2] > 0) result[c] = 1 / body.mass[c / 2];
  for (std::size_t r = 0; r < body.rigid.size(); ++r)
    for (std::size_t c = 0; c < 3; ++c)
      if (!body.rigid[r].held[c] && !(c < 2 && held[c]))
        result[2 * body.size() + 3 * r + c] = 1 / body.rigid[r].inertia_of(c);
  for (std::size_t k = 0; turning != nullptr && k < turning->size(); ++k)
    result.push_back(turning->turns(k) ? 1 / turning->inertia()[k] : 0.0);
  return result;
}

}  // namespace

ImpactSolver::ImpactSolver(const Body& body, ImpactOptions options)
    : Solver(body, Neighbourhood{}),
      friction_(options.friction),
      fluid_particle_(
          particles_that(body, [&](std::size_t i) { return options.is_fluid[body.member[i]] != 0; })),
      solid_particle_(particles_that(body,
                                     [&](std::size_t i) {
                                       const std::size_t m = body.member[i];
                                       return options.is_fluid[m] == 0 && !body.carried(i) &&
                                              (options.sections.empty() ||
                                               !(options.sections[m].thickness > 0));
                                     })),
      local_(body.size(), kNone),
      is_fluid_(body.size(), 0),
      is_shell_(body.size(), 0),
      fluid_(std::move(options.fluid), masses_of(body, fluid_particle_), members_of(body, fluid_particle_)),
      pinball_(body, std::move(options.contact)),
      rows_(options.sections.empty() ? std::nullopt
                                     : std::make_optional<ShellRow>(body, std::move(options.sections))),
      inverse_mass_(inverse_masses(body, options.held, friction_ > 0 && rows_ ? &*rows_ : nullptr)),
      impulses_(inverse_mass_),
      held_(options.held) {
  pairs_.first.assign(body.size() + 1, 0);
  for (std::uint32_t k = 0; k < fluid_particle_.size(); ++k) {
    local_[fluid_particle_[k]] = k;
    is_fluid_[fluid_particle_[k]] = 1;
    density_.push_back(body.mass[fluid_particle_[k]] / body.volume[fluid_particle_[k]]);
  }
  for (std::uint32_t k = 0; k < solid_particle_.size(); ++k) local_[solid_particle_[k]] = k;
  if (!solid_particle_.empty()) {
    solid_body_ = part_of(body, solid_particle_, local_);
    solid_ = options.make_solid(*solid_body_);
  }
  if (rows_) {
    row_history_ = rows_->rest_history();
    for (std::uint32_t k = 0; k < rows_->size(); ++k) {
      local_[rows_->particles()[k]] = k;
      is_shell_[rows_->particles()[k]] = 1;
    }
  }
  const std::size_t members = body.member.empty() ? 0 : std::size_t{body.member.back()} + 1;
  impulse_.assign(2 * members, 0.0);
  contact_force_ = impulse_;
  for (std::size_t i = 0; i < body.size(); ++i)
    fields_.deformation_gradient[4 * i] = fields_.deformation_gradient[4 * i + 3] = 1;
  surface_first_ = options.surface_first;
  if (surface_first_ != ImpactOptions::kNoSurface)
    surface_impulse_.assign(2 * (body.size() - surface_first_), 0.0);
  position_.resize(2 * body.size());
  velocity_.resize(inverse_mass_.size());
  before_ = velocity_;
  history_ = rest_history_ = gathered_history();
}

void ImpactSolver::copy_out(const std::vector<std::uint32_t>& particles, std::span<const double> from,
                            std::vector<double>& to) {
  to.resize(2 * particles.size());
  for (std::size_t k = 0; k < particles.size(); ++k) {
    to[2 * k] = from[2 * particles[k]];
    to[2 * k + 1] = from[2 * particles[k] + 1];
  }
}

std::vector<double> ImpactSolver::gathered_history() const {
  std::vector<double> history = row_history_;
  if (solid_) history.insert(history.end(), solid_->history().begin(), solid_->history().end());
  if (density_.empty()) return history;
  history.reserve(history.size() + fluid_history());
  history.insert(history.end(), density_.begin(), density_.end());
  fluid_.append_forces(history);
  history.push_back(forces_kept_ ? 1 : 0);
  return history;
}

void ImpactSolver::spread_history(const std::vector<double>& history) {
  const auto rows = history.begin() + static_cast<std::ptrdiff_t>(row_history_.size());
  const auto middle = history.end() - static_cast<std::ptrdiff_t>(fluid_history());
  row_history_.assign(history.begin(), rows);
  if (solid_) solid_->set_history({rows, middle});
  if (density_.empty()) return;
  static_cast<void>(fluid_.diffusion_work());  // of a step that failed
  const auto forces = middle + static_cast<std::ptrdiff_t>(density_.size());
  std::copy(middle, forces, density_.begin());
  fluid_.set_forces({forces, history.end() - 1});
  forces_kept_ = history.back() != 0;
}

void ImpactSolver::place(std::span<const double> displacement) {
  for (std::size_t c = 0; c < position_.size(); ++c) position_[c] = body_.position[c] + displacement[c];
  copy_out(fluid_particle_, position_, fluid_position_);
  if (solid_) copy_out(solid_particle_, displacement, solid_displacement_);
}

void ImpactSolver::copy_fields() {
  std::fill(fields_.force.begin(), fields_.force.end(), 0.0);
  for (std::size_t k = 0; k < fluid_particle_.size(); ++k)
    for (std::size_t c = 0; c < 2; ++c) fields_.force[2 * fluid_particle_[k] + c] = fluid_.force()[2 * k + c];
  if (!solid_) return;
  for (std::size_t k = 0; k < solid_particle_.size(); ++k) {
    const std::size_t i = solid_particle_[k];
    for (std::size_t c = 0; c < 2; ++c) fields_.force[2 * i + c] = solid_->fields().force[2 * k + c];
    for (std::size_t c = 0; c < 4; ++c)
      fields_.deformation_gradient[4 * i + c] = solid_->fields().deformation_gradient[4 * k + c];
  }
}

// `displacement` has to be that of the history: once a fluid has taken a step, its forces are those kept in
// it, viscous ones included.
std::int64_t ImpactSolver::evaluate(std::span<const double> displacement) {
  spread_history(history_);
  place(displacement);
  std::int64_t bad = 0;
  if (!forces_kept_ && !density_.empty()) {
    fluid_velocity_.assign(fluid_position_.size(), 0.0);
    bad += fluid_.measure(fluid_position_, fluid_velocity_, 0, density_);
    fluid_.find_forces(fluid_position_, fluid_velocity_, density_);
  }
  if (solid_) bad += solid_->evaluate(solid_displacement_);
  copy_fields();
  if (rows_) bad += rows_->evaluate(displacement, row_history_, false, fields_);
  return bad;
}

double ImpactSolver::energy(std::span<const double> displacement) const {
  double sum = fluid_.energy(density_);
  if (solid_) {
    std::vector<double> own;
    copy_out(solid_particle_, displacement, own);
    sum += solid_->energy(own);
  }
  return rows_ ? sum + rows_->energy() : sum;
}

double ImpactSolver::plastic_work() const {
  return (solid_ ? solid_->plastic_work() : 0) + (rows_ ? rows_->plastic_work(row_history_) : 0);
}

double ImpactSolver::fracture_work() const {
  return (solid_ ? solid_->fracture_work() : 0) + (rows_ ? rows_->fracture_work(row_history_) : 0);
}

std::vector<std::uint32_t> ImpactSolver::isolated() const {
  std::vector<std::uint32_t> result = rows_ ? rows_->isolated(row_history_) : std::vector<std::uint32_t>{};
  if (solid_)
    for (const std::uint32_t i : solid_->isolated()) result.push_back(solid_particle_[i]);
  return result;
}

bool ImpactSolver::cut_hanging(std::span<const double> displacement, std::vector<double>& history) {
  if (!solid_) return false;
  spread_history(history);
  copy_out(solid_particle_, displacement, solid_displacement_);
  std::vector<double> own = solid_->history();
  if (!solid_->cut_hanging(solid_displacement_, own)) return false;
  solid_->set_history(own);
  history = history_ = gathered_history();
  return true;
}

double ImpactSolver::kinetic_energy(const State& state) const {
  const double sum = Solver::kinetic_energy(state);
  return rows_ ? sum + rows_->kinetic_energy({state.history.data(), row_history_.size()}) : sum;
}

double ImpactSolver::spin(const State& state) const {
  return rows_ ? rows_->spin({state.history.data(), row_history_.size()}) : 0;
}

std::array<double, 16> ImpactSolver::tangent_at(std::size_t i) const {
  if (is_fluid_[i] == 0 && is_shell_[i] == 0 && local_[i] != kNone) return solid_->tangent_at(local_[i]);
  return {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
}

Tensor<double> ImpactSolver::first_piola_kirchhoff_at(std::size_t i) const {
  if (is_fluid_[i] != 0) {
    const double p = fluid_.pressure(local_[i], density_[local_[i]]);
    return {-p, 0, 0, -p};
  }
  if (local_[i] == kNone) return {};
  if (is_shell_[i] != 0) return rows_->first_piola_kirchhoff_at(local_[i]);
  return solid_->first_piola_kirchhoff_at(local_[i]);
}

double ImpactSolver::stress_across(std::size_t i) const {
  if (is_fluid_[i] != 0) return -fluid_.pressure(local_[i], density_[local_[i]]);
  return local_[i] == kNone || is_shell_[i] != 0 ? 0 : solid_->stress_across(local_[i]);
}

double ImpactSolver::stretch_across(std::size_t i) const {
  return is_fluid_[i] != 0 || is_shell_[i] != 0 || local_[i] == kNone ? 1 : solid_->stretch_across(local_[i]);
}

// Evaluates what the bound depends on: not the fluid's forces.
double ImpactSolver::longest_step(const State& state, double courant) {
  double step = std::numeric_limits<double>::infinity();
  spread_history(history_);
  place(state.displacement);
  copy_out(fluid_particle_, state.velocity, fluid_velocity_);
  if (!fluid_particle_.empty()) step = courant * kFluidShare * fluid_.stable_step(fluid_velocity_, density_);
  if (solid_) {
    double stable = solid_->reference_stable_step();
    solid_->evaluate(solid_displacement_);
    stable /= std::sqrt(solid_->steepening());
    step = std::min(step, courant * kSolidShare * stable / std::sqrt(std::max(1.0, solid_->stiffening())));
  }
  if (rows_) {
    rows_->evaluate(state.displacement, row_history_, false, fields_);
    step = std::min(step, courant * 2 / std::sqrt(rows_->squared_frequency(state.velocity, row_history_)));
  }
  double fastest = 0;
  for (std::size_t i = 0; i < body_.size(); ++i)
    fastest = std::max(fastest, std::hypot(state.velocity[2 * i], state.velocity[2 * i + 1]));
  if (fastest > 0) step = std::min(step, kFarthest * body_.mean_spacing() / fastest);
  return step;
}

EquilibriumReport ImpactSolver::relax(std::vector<double>&, const Loading&, double,
                                      const EquilibriumSettings&, const Monitor&) {
  throw std::logic_error("bodies that meet by impulses have no equilibrium search");
}

NamedValues ImpactSolver::quantities_of(std::size_t i, const State& state) const {
  const double across = stress_across(i);
  double pressure = 0, density = 0;
  if (is_fluid_[i] != 0) {
    pressure = -across;
    density = density_[local_[i]];
  } else if (local_[i] != kNone) {
    const Tensor<double> f = tensor_at(fields_.deformation_gradient, i), p = first_piola_kirchhoff_at(i);
    const double j = determinant(f) * stretch_across(i);
    pressure = -((p.xx * f.xx + p.xy * f.xy + p.yx * f.yx + p.yy * f.yy) / j + across) / 3;
    density = body_.mass[i] / body_.volume[i] / j;
  }
  NamedValues values{{"pressure", pressure}, {"density", density}};
  // The same names for every particle: frames have one column for all.
  if (solid_ && solid_->law_history() > 0) {
    const bool own = is_fluid_[i] == 0 && is_shell_[i] == 0 && local_[i] != kNone;
    const double* history = own ? &solid_->history()[J2Plasticity::history_size * local_[i]] : nullptr;
    values.emplace_back("plastic_strain", own ? history[4] : 0.0);
    values.emplace_back("damage", own ? history[5] : 0.0);
  }
  if (rows_) {
    const bool own = is_shell_[i] != 0;
    const auto section = own ? rows_->section_at(local_[i], row_history_) : std::array<double, 4>{};
    values.insert(values.end(), {{"rotation", own ? state.history[2 * local_[i]] : 0.0},
                                 {"normal_force", section[0]},
                                 {"shear_force", section[1]},
                                 {"bending_moment", section[2]},
                                 {"section_plastic_strain", section[3]}});
  }
  return values;
}

NamedValues ImpactSolver::totals(const State& state) const {
  NamedValues result{{"contact_time", state.contact_time}, {"contact_work", state.contact_work}};
  if (!fluid_.degrees().empty()) {
    const auto count = fluid_.degree_counts();
    result.insert(result.end(), {{"particles_of_degree_0", count[0]},
                                 {"particles_of_degree_1", count[1]},
                                 {"particles_of_degree_2", count[2]}});
  }
  if (rows_ && rows_->breakable()) {
    const auto lost = rows_->losses(row_history_);
    result.insert(result.end(), {{"broken_links", lost[0]},
                                 {"isolated_particles", lost[1]},
                                 {"isolated_mass", lost[2]},
                                 {"rupture_energy", lost[3]}});
  }
  if (solid_) {  // counts add up where shells break too
    for (const auto& [name, value] : solid_->totals(state)) {
      const auto same = std::find_if(result.begin(), result.end(),
                                     [&n = name](const auto& entry) { return entry.first == n; });
      if (same == result.end())
        result.emplace_back(name, value);
      else
        same->second += value;
    }
  }
  return result;
}

NamedValues ImpactSolver::quantities_of_body(std::size_t member, const State& state) const {
  NamedValues result{{"contact_force_x", contact_force_[2 * member]},
                     {"contact_force_y", contact_force_[2 * member + 1]}};
  double low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300}, energy = 0;
  bool fluid = false;
  for (std::size_t i = 0; i < body_.size(); ++i) {
    if (body_.member[i] != member) continue;
    for (std::size_t c = 0; c < 2; ++c) {
      const double x = body_.position[2 * i + c] + state.displacement[2 * i + c];
      low[c] = std::min(low[c], x);
      high[c] = std::max(high[c], x);
    }
    if (is_fluid_[i] == 0) continue;
    fluid = true;
    energy += fluid_.mass(local_[i]) * fluid_.energy_of(local_[i], density_[local_[i]]);
  }
  result.insert(result.end(), {{"left", low[0]}, {"right", high[0]}, {"bottom", low[1]}, {"top", high[1]}});
  if (fluid) result.emplace_back("internal_energy", energy);
  return result;
}

NamedValues ImpactSolver::phase_seconds() const {
  return {{"fluid", fluid_seconds_}, {"solid", solid_seconds_}, {"contact", contact_seconds_}};
}

}  // namespace estuary::solid
