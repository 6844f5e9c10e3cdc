#include "output.hpp"

#include <cmath>

namespace estuary::fluid {

Output::Output(const std::filesystem::path& folder)
    : folder_(folder), frames_(folder, "frame"), surfaces_(folder, "surface") {}

void Output::write_fields(const std::filesystem::path& file, const Flow& flow, const Fields& fields,
                          const Units& units) const {
  const Grid& grid = flow.grid();
  const std::size_t count = fields.excess.size();
  const std::size_t components = grid.nz > 0 ? 3 : 2;
  std::vector<double> velocity(components * count);
  std::vector<double> pressure(count);
  std::vector<double> solid(count);
  const auto finite = [](double value) { return std::isfinite(value) ? value : 0.0; };
  const double to_velocity = 1 / units.velocity_to_lattice();
  const double to_pressure = D2Q9::sound_speed_squared * units.stress();
  if (!flow.grains().empty()) flow.grains().fractions(solid);
  for (std::size_t k = 0; k < count; ++k) {
    velocity[components * k] = finite(fields.velocity_x[k] * to_velocity);
    velocity[components * k + 1] = finite(fields.velocity_y[k] * to_velocity);
    if (components == 3) velocity[components * k + 2] = finite(fields.velocity_z[k] * to_velocity);
    pressure[k] = finite(fields.excess[k] * to_pressure);
    const auto x = static_cast<int>(k % static_cast<std::size_t>(grid.nx));
    const auto row = static_cast<int>(k / static_cast<std::size_t>(grid.nx));
    if (!flow.cells().fluid(x, row % grid.ny, row / grid.ny)) solid[k] = 1;
  }
  const std::vector<FieldView> views{{"velocity", static_cast<std::uint32_t>(components), velocity},
                                     {"pressure", 1, pressure},
                                     {"solid", 1, solid}};
  write_image(file,
              {static_cast<std::uint32_t>(grid.nx), static_cast<std::uint32_t>(grid.ny),
               static_cast<std::uint32_t>(grid.layers())},
              {grid.x0, grid.y0, grid.z0}, grid.spacing, views);
}

std::vector<std::string> Output::write(std::uint64_t number, double time, const Flow& flow,
                                       const Fields& fields, const Units& units,
                                       const std::vector<double>& pressure,
                                       const std::vector<double>& traction) {
  std::vector<std::string> files{frames_.file_name(number)};
  write_fields(folder_ / files.back(), flow, fields, units);
  frames_.add(number, time);
  if (const Surface* surface = flow.wet_surface()) {
    const std::size_t nodes = surface->node_count();
    std::vector<double> positions(2 * nodes);
    std::vector<double> velocity(2 * nodes);
    std::vector<double> gauge(nodes, 0.0);
    std::vector<double> stress(2 * nodes, 0.0);
    for (std::size_t n = 0; n < nodes; ++n) {
      positions[2 * n] = flow.grid().x(surface->positions()[2 * n]);
      positions[2 * n + 1] = flow.grid().y(surface->positions()[2 * n + 1]);
    }
    for (std::size_t k = 0; k < 2 * nodes; ++k) {
      velocity[k] = surface->velocities()[k] / units.velocity_to_lattice();
      if (k < traction.size()) stress[k] = traction[k] * units.stress();
    }
    for (std::size_t n = 0; n < pressure.size() && n < nodes; ++n) gauge[n] = pressure[n] * units.stress();
    const std::vector<FieldView> views{
        {"velocity", 2, velocity}, {"pressure", 1, gauge}, {"traction", 2, stress}};
    files.push_back(surfaces_.file_name(number));
    write_points(folder_ / files.back(), 2, positions, surface->connectivity(), views);
    surfaces_.add(number, time);
  }
  return files;
}

std::string Output::write_diverged(const Flow& flow, const Fields& fields, const Units& units) const {
  std::string name = "diverged.hdf";
  write_fields(folder_ / name, flow, fields, units);
  return name;
}

}  // namespace estuary::fluid
