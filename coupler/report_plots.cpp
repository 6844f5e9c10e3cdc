#include "report_plots.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "csv_file.hpp"
#include "curves.hpp"
#include "flow_picture.hpp"
#include "frame_reader.hpp"
#include "particle_picture.hpp"

namespace estuary::coupler {
namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

/// Draws and adds a plot, or says why not.
void add_plot(ReportPage& page, const CurvePlot& plot, const std::filesystem::path& picture,
              const std::string& caption, const Gnuplot& gnuplot) {
  try {
    draw_curves(plot, picture, gnuplot);
    page.picture(picture, caption, false);
  } catch (const std::runtime_error& error) {
    page.paragraph(fmt::format("No plot of {}: {}.", caption, error.what()));
  }
}

/// Residual over the rows; windows are separated by a gap, because the residual starts anew in each.
Curve residual_curve(const CsvFile& table, const std::string& name, const std::vector<double>& residual) {
  Curve curve{.name = name, .x = {}, .y = {}};
  const auto* window = table.column("window");
  for (std::size_t i = 0; i < residual.size(); ++i) {
    if (window != nullptr && i > 0 && (*window)[i] != (*window)[i - 1]) {
      curve.x.push_back(static_cast<double>(i) + 0.5);
      curve.y.push_back(nothing);
    }
    curve.x.push_back(static_cast<double>(i + 1));
    curve.y.push_back(residual[i]);
  }
  return curve;
}

double last_of(const CsvFile& table, const std::string& name) {
  const auto* column = table.column(name);
  return column == nullptr || column->empty() ? nothing : column->back();
}

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.6g}", value) : "-";
}

void add_balance(ReportPage& page, const CsvFile& table) {
  struct Row {
    const char* name;
    const char* fluid;     // by the fluid's own sum
    const char* exchange;  // of the nodal forces
    const char* solid;     // as the solid received them
  };
  constexpr std::array<Row, 4> quantities{
      {{"force along x [N/m]", "fluid_force_x", "force_x", "solid_force_x"},
       {"force along y [N/m]", "fluid_force_y", "force_y", "solid_force_y"},
       {"moment about the origin [N]", "fluid_moment", "moment", "solid_moment"},
       {"power [W/m]", "fluid_power", "", "solid_power"}}};
  std::vector<std::vector<std::string>> rows;
  for (const auto& quantity : quantities) {
    const double fluid = last_of(table, quantity.fluid);
    const double exchange = last_of(table, quantity.exchange);
    const double solid = last_of(table, quantity.solid);
    if (std::isnan(fluid) && std::isnan(exchange) && std::isnan(solid)) continue;
    const double size = std::max(std::abs(fluid), std::abs(solid));
    const double difference = size > 0 ? std::abs(fluid - solid) / size : 0.0;
    rows.push_back({quantity.name, number(fluid), number(exchange), number(solid),
                    std::isfinite(difference) ? fmt::format("{:.2e}", difference) : "-"});
  }
  if (rows.empty()) return;
  page.subheading("Balance at the wet surface, last exchange");
  page.table({"", "fluid's own sum", "nodal forces", "received by the solid", "relative difference"}, rows);
}

/// One curve per quantity of a watch, over time; of repeated times the last value counts, because it is that
/// of the last iteration of the window.
Curve watch_curve(const std::vector<double>& time, const std::vector<double>& values) {
  Curve curve;
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (i + 1 < time.size() && time[i + 1] == time[i]) continue;
    curve.x.push_back(time[i]);
    curve.y.push_back(values[i]);
  }
  return curve;
}

bool varies(const std::vector<double>& values) {
  return std::any_of(values.begin(), values.end(), [&](double value) { return value != values.front(); });
}

void add_watch(ReportPage& page, const ReportPlaces& places, const ReportScene& scene, const Gnuplot& gnuplot,
               const std::filesystem::path& file, std::size_t number_of_watch) {
  constexpr std::size_t most_plots = 24;
  const auto table = read_csv(file);
  const auto* time = table ? table->column("time") : nullptr;
  page.subheading(file.stem().string());
  if (time == nullptr || time->empty()) {
    page.paragraph(fmt::format("{} holds no values.", file.filename().string()));
    return;
  }
  std::vector<std::string> constant;
  std::size_t drawn = 0;
  page.begin_gallery();
  for (std::size_t i = 0; i < table->names.size(); ++i) {
    const auto& name = table->names[i];
    if (name == "window" || name == "iteration" || name == "time") continue;
    const auto& values = table->columns[i];
    if (!varies(values)) {
      constant.push_back(fmt::format("{} = {}", name, number(values.front())));
      continue;
    }
    if (++drawn > most_plots) continue;
    const CurvePlot plot{.x_label = scene.steady ? "iteration" : "time [s]",
                         .y_label = name,
                         .curves = {watch_curve(*time, values)},
                         .levels = {}};
    // The picture's name holds no part of the watch's, which a person chose.
    add_plot(page, plot, places.pictures / fmt::format("watch-{:02}-{:02}.svg", number_of_watch, i),
             fmt::format("{}.{}, at the end {}", file.stem().string(), name, number(values.back())), gnuplot);
  }
  page.end_gallery();
  if (!constant.empty()) page.paragraph(fmt::format("The same throughout: {}.", fmt::join(constant, ", ")));
  if (drawn > most_plots)
    page.paragraph(
        fmt::format("{} more quantities are in {}.", drawn - most_plots, file.filename().string()));
}

}  // namespace

void add_field_pictures(ReportPage& page, const ReportPlaces& places, const ReportScene& scene,
                        const Gnuplot& gnuplot) {
  const auto add = [&](const auto& draw) {
    try {
      const Picture picture = draw();
      page.picture(picture.file, picture.caption, true);
    } catch (const std::exception& error) {
      page.paragraph(error.what());
    }
  };
  const auto took_part = [&](const char* role) { return last_frame(places.run / role, "frame").has_value(); };
  const bool fluid = took_part("fluid");
  if (fluid || std::filesystem::is_directory(places.run / "fluid")) {
    add([&] {
      return draw_flow(places.run, places.pictures / "flow.png", places.work, scene.steady, gnuplot);
    });
  }
  const auto first = fluid ? first_frame(places.run / "fluid", "frame") : std::nullopt;
  if (first && first->file != last_frame(places.run / "fluid", "frame")->file) {
    add([&] {
      return draw_flow(places.run, places.pictures / "flow-first.png", places.work, scene.steady, gnuplot,
                       WhichFrame::first);
    });
  }
  for (const char* role : {"solid", "grains"}) {
    if (!took_part(role)) continue;
    add([&] {
      return draw_particles(places.run, role, places.pictures / fmt::format("{}.png", role), scene.steady,
                            gnuplot);
    });
  }
  if (!fluid && !took_part("solid") && !took_part("grains"))
    page.paragraph("No participant left frames, so there is no picture of the fields.");
}

void add_convergence(ReportPage& page, const ReportPlaces& places, const ReportScene& scene,
                     const std::optional<Gnuplot>& gnuplot) {
  const auto table = read_csv(places.run / "convergence.csv");
  const auto* residual = table ? table->column("residual") : nullptr;
  if (residual == nullptr || residual->empty()) {
    page.paragraph("One participant alone: there is nothing to converge between participants.");
    return;
  }
  CurvePlot plot{.x_label = "iteration, all windows counted",
                 .y_label = "residual",
                 .logarithmic = true,
                 .curves = {residual_curve(*table, "displacements", *residual)},
                 .levels = {},
                 .width = 640,
                 .height = 340};
  if (const auto* force = table->column("force_residual");
      force != nullptr &&
      std::any_of(force->begin(), force->end(), [](double value) { return std::isfinite(value); })) {
    plot.curves.push_back(residual_curve(*table, "forces", *force));
  }
  if (scene.tolerance > 0) plot.levels.emplace_back("tolerance", scene.tolerance);
  if (gnuplot) {
    add_plot(page, plot, places.pictures / "convergence.svg",
             "Residual of each iteration, |d_k - d_(k-1)| / |d_k| over the wet nodes", *gnuplot);
  }
  page.paragraph(
      fmt::format("{} iterations; the last residual is {}.", residual->size(), number(residual->back())));
  add_balance(page, *table);
}

void add_watches(ReportPage& page, const ReportPlaces& places, const ReportScene& scene,
                 const Gnuplot& gnuplot) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(places.run / "watch", error)) {
    if (entry.path().extension() == ".csv") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  if (files.empty()) page.paragraph("The scene watches nothing.");
  for (std::size_t i = 0; i < files.size(); ++i) add_watch(page, places, scene, gnuplot, files[i], i);
}

}  // namespace estuary::coupler
