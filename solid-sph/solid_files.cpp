// What the solid writes: frames for viewers and checkpoints.
#include <cmath>

#include "checkpoint.hpp"
#include "solid.hpp"

namespace estuary::solid {

void Solid::write_particles(const std::filesystem::path& file) const {
  const std::size_t n = body_.size();
  std::vector<double> position(2 * n), cauchy_xx(n), cauchy_yy(n), cauchy_xy(n), cauchy_zz(n), von_mises(n);
  const Fields& fields = solver_->fields();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t c = 0; c < 2; ++c)
      position[2 * i + c] = body_.position[2 * i + c] + state_.displacement[2 * i + c];
    const Tensor<double> f = tensor_at(fields.deformation_gradient, i);
    const Tensor<double> sigma =
        scaled(product(solver_->first_piola_kirchhoff_at(i), transposed(f)), 1 / determinant(f));
    const double zz = solver_->stress_across(i);
    cauchy_xx[i] = sigma.xx;
    cauchy_yy[i] = sigma.yy;
    cauchy_xy[i] = 0.5 * (sigma.xy + sigma.yx);
    cauchy_zz[i] = zz;
    const double a = sigma.xx - sigma.yy, b = sigma.yy - zz, c = zz - sigma.xx;
    von_mises[i] = std::sqrt(0.5 * (a * a + b * b + c * c) + 3 * cauchy_xy[i] * cauchy_xy[i]);
  }
  const std::vector<FieldView> views{{"displacement", 2, state_.displacement},
                                     {"velocity", 2, state_.velocity},
                                     {"von_mises", 1, von_mises},
                                     {"cauchy_xx", 1, cauchy_xx},
                                     {"cauchy_yy", 1, cauchy_yy},
                                     {"cauchy_xy", 1, cauchy_xy},
                                     {"cauchy_zz", 1, cauchy_zz}};
  write_points(file, 2, position, {}, views);
}

void Solid::write_surface(const std::filesystem::path& file) const {
  v1::Displacements field;
  fill_displacements(field);
  const std::vector<double> displacement(field.displacement().begin(), field.displacement().end());
  const std::vector<double> velocity(field.velocity().begin(), field.velocity().end());
  std::vector<double> position = line_.position;
  for (std::size_t c = 0; c < position.size(); ++c) position[c] += displacement[c];
  const std::vector<std::uint32_t> segments(surface_.connectivity().begin(), surface_.connectivity().end());
  const std::vector<FieldView> views{
      {"displacement", 2, displacement}, {"velocity", 2, velocity}, {"force", 2, forces_}};
  write_points(file, 2, position, segments, views);
}

std::vector<std::string> Solid::frame(std::uint64_t number, double time) {
  solver_->evaluate(state_.displacement);
  std::vector<std::string> files{particle_series_->file_name(number)};
  write_particles(folder_ / files.front());
  particle_series_->add(number, time);
  if (!line_.position.empty()) {
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
  const std::array<double, 3> numbers{accepted_.time, accepted_.external_work, work_.updates};
  writer.add("numbers", numbers);
  if (!line_.position.empty()) writer.add("forces", accepted_forces_);
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
  std::array<double, 3> numbers{};
  reader.read("numbers", numbers);
  loaded.time = numbers[0];
  loaded.external_work = numbers[1];
  std::vector<double> forces(accepted_forces_.size());
  if (!line_.position.empty()) reader.read("forces", forces);
  for (const std::vector<double>* values : {&loaded.displacement, &loaded.velocity, &forces})
    for (const double value : *values)
      if (!std::isfinite(value))
        throw std::runtime_error(file.string() + " holds a value that is not finite");
  work_.steps = reader.read_count("steps");
  work_.updates = numbers[2];
  accepted_ = loaded;
  state_ = std::move(loaded);
  accepted_forces_ = forces;
  forces_ = std::move(forces);
}

}  // namespace estuary::solid
