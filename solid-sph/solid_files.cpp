// What the solid writes: frames for viewers and checkpoints.
#include <cmath>

#include "checkpoint.hpp"
#include "solid.hpp"

namespace estuary::solid {

void Solid::write_particles(const std::filesystem::path& file) const {
  const std::size_t n = body_.particles();
  std::vector<double> position(2 * n), body(n);
  std::array<std::vector<double>, 7> stress;
  std::array<std::vector<double>, 4> gradient;
  for (auto& values : stress) values.resize(n);
  for (auto& values : gradient) values.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t c = 0; c < 2; ++c)
      position[2 * i + c] = body_.position[2 * i + c] + state_.displacement[2 * i + c];
    const auto one = particle_stress(i);
    for (std::size_t c = 0; c < stress.size(); ++c) stress[c][i] = one[c];
    for (std::size_t c = 0; c < 4; ++c) gradient[c][i] = solver_->fields().deformation_gradient[4 * i + c];
    body[i] = body_.member[i];
  }
  const std::span<const double> displacement(state_.displacement.data(), 2 * n),
      velocity(state_.velocity.data(), 2 * n);
  std::vector<FieldView> views{{"displacement", 2, displacement},
                               {"velocity", 2, velocity},
                               {"von_mises", 1, stress[4]},
                               {"cauchy_xx", 1, stress[0]},
                               {"cauchy_yy", 1, stress[1]},
                               {"cauchy_xy", 1, stress[2]},
                               {"cauchy_zz", 1, stress[3]},
                               {"deformation_gradient_xx", 1, gradient[0]},
                               {"deformation_gradient_xy", 1, gradient[1]},
                               {"deformation_gradient_yx", 1, gradient[2]},
                               {"deformation_gradient_yy", 1, gradient[3]}};
  if (scene_.bodies.size() > 1) views.push_back({"body", 1, body});
  if (scene_.plastic() && !scene_.shells() && !scene_.impact()) {
    views.push_back({"plastic_strain", 1, stress[5]});
    views.push_back({"damage", 1, stress[6]});
  }
  const NamedValues names = n > 0 ? solver_->quantities_of(0, state_) : NamedValues{};
  std::vector<std::vector<double>> more(names.size(), std::vector<double>(n));
  for (std::size_t i = 0; !names.empty() && i < n; ++i) {
    const NamedValues one = solver_->quantities_of(i, state_);
    for (std::size_t k = 0; k < one.size(); ++k) more[k][i] = one[k].second;
  }
  for (std::size_t k = 0; k < names.size(); ++k) views.push_back({names[k].first, 1, more[k]});
  write_points(file, 2, position, {}, views);
}

void Solid::write_surface(const std::filesystem::path& file) const {
  v1::Displacements field;
  fill_displacements(field);
  const std::vector<double> displacement(field.displacement().begin(), field.displacement().end());
  const std::vector<double> velocity(field.velocity().begin(), field.velocity().end());
  std::vector<double> position = wet_nodes_;
  for (std::size_t c = 0; c < position.size(); ++c) position[c] += displacement[c];
  const std::vector<std::uint32_t> segments(surface_.connectivity().begin(), surface_.connectivity().end());
  const std::vector<FieldView> views{
      {"displacement", 2, displacement}, {"velocity", 2, velocity}, {"force", 2, forces_}};
  write_points(file, 2, position, segments, views);
}

std::vector<std::string> Solid::frame(std::uint64_t number, double time) {
  solver_->set_history(state_.history);
  solver_->evaluate(state_.displacement);
  std::vector<std::string> files{particle_series_->file_name(number)};
  write_particles(folder_ / files.front());
  particle_series_->add(number, time);
  if (!wet_nodes_.empty()) {
    files.push_back(surface_series_->file_name(number));
    write_surface(folder_ / files.back());
    surface_series_->add(number, time);
  }
  return files;
}

void Solid::save(const std::filesystem::path& file) {
  CheckpointWriter writer(file);
  writer.add("particles", static_cast<std::uint64_t>(body_.size()));
  writer.add("surface", static_cast<std::uint64_t>(surface_.identity()));
  writer.add("steps", work_.steps);
  writer.add("displacement", accepted_.displacement);
  writer.add("velocity", accepted_.velocity);
  if (!accepted_.history.empty()) writer.add("history", accepted_.history);
  const std::array<double, 6> numbers{accepted_.time, accepted_.external_work, accepted_.viscous_work,
                                      work_.updates,  accepted_.contact_time,  accepted_.contact_work};
  writer.add("numbers", numbers);
  if (!accepted_.rigid.empty()) writer.add("rigid", accepted_.rigid);
  if (scene_.remove_isolated) {
    std::vector<double> removed(accepted_.removed.begin(), accepted_.removed.end());
    removed.resize(body_.size(), 0.0);
    const Removed& lost = accepted_.lost;
    removed.insert(removed.end(), {lost.count, lost.mass, lost.momentum[0], lost.momentum[1],
                                   lost.angular_momentum, lost.energy});
    writer.add("removed", removed);
  }
  if (!wet_nodes_.empty()) writer.add("forces", accepted_forces_);
  if (!wet_nodes_.empty() && scene_.window_load == WindowLoad::quadratic) {
    // No duration: there is no window before.
    writer.add("earlier_forces", earlier_forces_.empty() ? accepted_forces_ : earlier_forces_);
    writer.add("earlier_duration", std::array<double, 1>{earlier_forces_.empty() ? 0.0 : earlier_duration_});
  }
  writer.commit();
}

void Solid::load(const std::filesystem::path& file) {
  const CheckpointReader reader(file);
  if (reader.read_count("particles") != body_.size() || reader.read_count("surface") != surface_.identity())
    throw std::runtime_error(
        file.string() + " belongs to another body: " + std::to_string(reader.read_count("particles")) +
        " particles there, " + std::to_string(body_.size()) + " here, or another wet surface");
  State loaded = at_rest(body_);
  reader.read("displacement", loaded.displacement);
  reader.read("velocity", loaded.velocity);
  loaded.history = accepted_.history;
  if (!loaded.history.empty()) reader.read("history", loaded.history);
  if (!loaded.rigid.empty()) reader.read("rigid", loaded.rigid);
  std::vector<double> removed(scene_.remove_isolated ? body_.size() + 6 : 0);
  if (!removed.empty()) {
    reader.read("removed", removed);
    const double* lost = &removed[body_.size()];
    if (lost[0] > 0) loaded.removed.assign(removed.begin(), removed.end() - 6);
    loaded.lost = {lost[0], lost[1], {lost[2], lost[3]}, lost[4], lost[5]};
  }
  std::array<double, 6> numbers{};
  reader.read("numbers", numbers);
  loaded.time = numbers[0];
  loaded.external_work = numbers[1];
  loaded.viscous_work = numbers[2];
  std::vector<double> forces(accepted_forces_.size());
  if (!wet_nodes_.empty()) reader.read("forces", forces);
  std::vector<double> earlier_forces;
  std::array<double, 1> earlier_duration{};
  if (!wet_nodes_.empty() && scene_.window_load == WindowLoad::quadratic) {
    earlier_forces.resize(forces.size());
    reader.read("earlier_forces", earlier_forces);
    reader.read("earlier_duration", earlier_duration);
    if (!(earlier_duration[0] > 0)) earlier_forces.clear();
  }
  for (const std::vector<double>* values : {&loaded.displacement, &loaded.velocity, &loaded.history,
                                            &loaded.rigid, &removed, &forces, &earlier_forces})
    for (const double value : *values)
      if (!std::isfinite(value))
        throw std::runtime_error(file.string() + " holds a value that is not finite");
  work_.steps = reader.read_count("steps");
  work_.updates = numbers[3];
  loaded.contact_time = numbers[4];
  loaded.contact_work = numbers[5];
  accepted_ = loaded;
  state_ = std::move(loaded);
  earlier_forces_ = std::move(earlier_forces);
  earlier_duration_ = earlier_duration[0];
  accepted_forces_ = forces;
  forces_ = std::move(forces);
}

}  // namespace estuary::solid
