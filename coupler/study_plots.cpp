#include "study_plots.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace estuary::coupler {
namespace {

// Distinct for every kind of colour vision (Okabe & Ito 2008).
constexpr std::array<const char*, 8> colours{"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                             "#e69f00", "#56b4e9", "#000000", "#8c6d00"};
constexpr double least_shown = 1e-16;  // an exact result on a logarithmic axis

struct Point {
  double x, y, low, high;
  bool on_front;
};

struct Interval {
  double low = INFINITY;
  double high = -INFINITY;
  void include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
};

std::vector<Point> points_of(const StudyResults& all, const StudySeries& series,
                             std::optional<std::size_t> quantity, StudyAbscissa abscissa) {
  std::vector<Point> points;
  for (const std::size_t k : series.results) {
    const StudyResult& result = all.results[k];
    const double error = quantity ? result.quantities[*quantity].error : result.error;
    if (!std::isfinite(error)) continue;
    if (abscissa == StudyAbscissa::size) {
      if (result.cell.size)
        points.push_back({*result.cell.size, std::max(100 * error, least_shown), 0, 0, false});
    } else if (result.cost_s > 0) {
      points.push_back({result.cost_s, std::max(100 * error, least_shown),
                        all.by_processor ? result.cost_s : result.wall_min_s,
                        all.by_processor ? result.cost_s : result.wall_max_s, result.on_front});
    }
  }
  return points;
}

/// Over less than two decades gnuplot itself names hardly a value.
std::string ticks(char axis, const Interval& range) {
  if (range.high / range.low > 200) return {};
  std::string text;
  for (int decade = static_cast<int>(std::floor(std::log10(range.low))) - 1;
       decade <= std::log10(range.high) + 1; ++decade) {
    for (const int first : {1, 2, 5}) text += fmt::format("{}{}e{}", text.empty() ? "" : ", ", first, decade);
  }
  return fmt::format("set {}tics ({})\n", axis, text);
}

std::string axis_range(char axis, const Interval& range, double margin) {
  return ticks(axis, range) +
         fmt::format("set {}range [{:.6g}:{:.6g}]\n", axis, range.low / margin, range.high * margin);
}

}  // namespace

void draw_svg_and_png(const std::string& script, unsigned width, unsigned height,
                      const std::filesystem::path& stem, const Gnuplot& gnuplot) {
  auto file = stem;
  gnuplot.draw(
      file.replace_extension(".svg"),
      fmt::format("svg size {},{} font 'Helvetica,Arial,sans-serif,13' background 'white'", width, height),
      script);
  gnuplot.draw(file.replace_extension(".png"),
               fmt::format("pngcairo size {},{} font 'Sans,11'", width, height), script);
}

void draw_study(const StudyResults& all, std::optional<std::size_t> quantity, StudyAbscissa abscissa,
                const std::filesystem::path& stem, const Gnuplot& gnuplot) {
  Interval x_range;
  Interval y_range;
  std::string script =
      "set border 3 lc rgb '#606060'\nset tics nomirror out scale 0.5\nset grid lc rgb '#e4e4e4' lt 1 lw "
      "0.7\n"
      "set logscale xy\n";
  std::string pieces;
  const auto add_piece = [&](const std::string& piece) {
    pieces += (pieces.empty() ? "plot " : ", ") + piece;
  };
  std::vector<Point> front;
  std::size_t lines = 0;
  for (const auto& series : all.series) {
    const auto points = points_of(all, series, quantity, abscissa);
    if (points.empty()) continue;
    script += fmt::format("$line{} << END\n", lines);
    for (const auto& point : points) {
      script += fmt::format("{:.9g} {:.9g} {:.9g} {:.9g}\n", point.x, point.y, point.low, point.high);
      x_range.include(point.x);
      y_range.include(point.y);
      if (abscissa == StudyAbscissa::cost) {
        x_range.include(point.low);
        x_range.include(point.high);
      }
      if (point.on_front) front.push_back(point);
    }
    script += "END\n";
    const auto order = quantity ? series.orders[*quantity] : series.order;
    std::string name = series.name;
    if (order) name += fmt::format("{}observed order {:.1f}", name.empty() ? "" : ", ", *order);
    const auto title = name.empty() ? std::string("notitle") : "title " + Gnuplot::quoted(name);
    const auto* colour = colours[lines % colours.size()];
    const auto mark = 5 + 2 * (lines / colours.size());
    add_piece(fmt::format("$line{} using 1:2 with linespoints lc rgb '{}' lw 1.8 pt {} ps 0.8 {}", lines,
                          colour, mark, title));
    if (abscissa == StudyAbscissa::cost)
      add_piece(fmt::format("$line{} using 1:2:3:4 with xerrorbars lc rgb '{}' lw 1.2 pt 0 notitle", lines,
                            colour));
    ++lines;
  }
  if (lines == 0) throw std::runtime_error("no cell has an error that can be drawn");
  if (!front.empty()) {
    std::sort(front.begin(), front.end(), [](const Point& a, const Point& b) { return a.x < b.x; });
    script += "$front << END\n";
    for (const auto& point : front) script += fmt::format("{:.9g} {:.9g}\n", point.x, point.y);
    script += "END\n";
    // With several quantities the front is that of the largest error, and no staircase in one of them.
    if (!quantity || all.quantities.size() == 1)
      add_piece("$front using 1:2 with steps lc rgb '#909090' lw 1 dt 2 notitle");
    add_piece(
        "$front using 1:2 with points lc rgb '#202020' lw 1.5 pt 6 ps 2 title 'none is better in both'");
  }
  script += fmt::format("set key {} samplen 2 spacing 1.1\n", lines > 4 ? "outside below" : "top right");
  script += axis_range('x', x_range, 1.3) + axis_range('y', y_range, lines > 4 ? 1.6 : 2.5);
  const std::string what = quantity                     ? "error of " + all.quantities[*quantity].name
                           : all.quantities.size() == 1 ? "error of " + all.quantities.front().name
                                                        : "largest error";
  script += fmt::format(
      "set xlabel {}\nset ylabel {}\nset format xy '%g'\n",
      Gnuplot::quoted(abscissa == StudyAbscissa::size ? "size of a step of the ladder"
                                                      : all.cost_name() + std::string(" of the run [s]")),
      Gnuplot::quoted(what + " [%]"));
  const auto height = static_cast<unsigned>(lines > 4 ? 460 + 10 * lines : 440);
  draw_svg_and_png(script + pieces + "\n", 760, height, stem, gnuplot);
}

}  // namespace estuary::coupler
