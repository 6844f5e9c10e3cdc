// The folder of a run as the coupler and its participants leave it, small and with known values.
#pragma once

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "field_file.hpp"
#include "temporary_folder.hpp"

namespace estuary::coupler::testing {

class SampleRun {
public:
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

  void write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
  }
  [[nodiscard]] std::string read(const std::string& name) const {
    std::ifstream stream(folder_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  void write_tables() const {
    write("scene.toml", "title = \"A <fin> & 'more'\"\n[coupling]\nmode = \"steady\"\ntolerance = 1e-4\n");
    write("summary.json", R"({
 "scene": "configs/fin.toml", "title": "A <fin> & 'more'", "status": "check failed", "message": "", "wall_s": 12.5,
 "windows": 1, "iterations": {"total": 3, "mean": 3.0, "max": 3},
 "participants": {"fluid": {"solver": "fluid-lbm", "version": "0.1.0", "wall_s": 9, "compute_s": 8.25, "wait_s": 3.5,
   "exchange_s": 0.1, "steps": 4711, "updates": 1e6, "updates_per_s": 2.5e7, "bytes_per_update": 144,
   "peak_rss_bytes": 52000000, "phases": {"collide and stream": 8.0, "wet surface": 0.25}, "variant": "D2Q9 TRT",
   "plan": {"relaxation time": "0.8"}, "warnings": ["Mach number 0.2 is high"]}},
 "coupling": {"exchange_s": 0.125, "bytes": 123456, "messages": 42}, "left_out": ["the grains"],
 "watch": {"tip": {"displacement": {"last": 0.19, "min": 0, "max": 0.19, "mean": 0.1}}},
 "checks": [
  {"quantity": "tip.displacement", "value": 0.19, "reference": 0.184, "error": 0.0326, "tolerance": 0.05,
   "absolute": false, "pass": true, "source": "a book"},
  {"quantity": "tip.other", "value": null, "reference": 1.5, "error": null, "tolerance": 0.25, "absolute": true,
   "pass": false, "source": "<b>x</b>"},
  {"quantity": "coupling.iterations", "value": 12, "reference": null, "at_most": 10, "error": null, "tolerance": null,
   "absolute": false, "pass": false, "source": ""}]
})");
    write("convergence.csv",
          "window,iteration,time,residual,force_residual,force_x,force_y,fluid_force_x,fluid_force_y,solid_"
          "force_x,"
          "solid_force_y\n"
          "1,1,1,1,,2,0.5,2,0.5,2,0.5\n1,2,2,0.01,,2.5,0.5,2.5,0.5,2.5,0.5\n1,3,3,5e-05,,3,0.5,3,0.5,2.7,0."
          "5\n1,4,4");
    write("watch/tip.csv",
          "window,iteration,time,displacement,always\n1,1,1,0.05,7\n1,2,2,0.2,7\n1,3,3,0.19,7\n");
  }

  /// Flow along x, u = 4 y (1 - y), with one column blocked, around a small square of particles.
  void write_frames() const {
    constexpr std::uint32_t nx = 40;
    constexpr std::uint32_t ny = 20;
    constexpr double h = 0.05;
    std::vector<double> velocity(2 * nx * ny, 0.0);
    std::vector<double> pressure(nx * ny);
    std::vector<double> solid(nx * ny, 0.0);
    for (std::uint32_t j = 0; j < ny; ++j) {
      for (std::uint32_t i = 0; i < nx; ++i) {
        const double y = (j + 0.5) * h;
        const std::size_t k = std::size_t{j} * nx + i;
        velocity[2 * k] = 4 * y * (1 - y);
        pressure[k] = 10.0 - i * h;
        solid[k] = i == 20 && j < 5 ? 1.0 : 0.0;
      }
    }
    std::filesystem::create_directories(folder_ / "fluid");
    std::filesystem::create_directories(folder_ / "solid");
    const std::vector<FieldView> fields{
        {"velocity", 2, velocity}, {"pressure", 1, pressure}, {"solid", 1, solid}};
    FieldSeries frames(folder_ / "fluid", "frame");
    write_image(folder_ / "fluid" / frames.file_name(3), {nx, ny, 1}, {0.5 * h, 0.5 * h, 0}, h, fields);
    frames.add(3, 7.0);
    const std::vector<double> particles{1.0, 0.05, 1.05, 0.05, 1.0, 0.1, 1.05, 0.1};
    FieldSeries particle_frames(folder_ / "solid", "frame");
    write_points(folder_ / "solid" / particle_frames.file_name(3), 2, particles, {}, {});
    particle_frames.add(3, 7.0);
    const std::vector<double> outline{0.975, 0.0, 0.975, 0.25, 1.075, 0.25};
    const std::vector<double> displacement{0.0, 0.0, 0.01, 0.0, 0.01, 0.0};
    const std::vector<std::uint32_t> segments{0, 1, 1, 2};
    const std::vector<FieldView> surface_fields{{"displacement", 2, displacement}};
    FieldSeries surfaces(folder_ / "solid", "surface");
    write_points(folder_ / "solid" / surfaces.file_name(3), 2, outline, segments, surface_fields);
    surfaces.add(3, 7.0);
  }

private:
  estuary::TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
};

}  // namespace estuary::coupler::testing
