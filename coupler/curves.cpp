#include "curves.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace estuary::coupler {
namespace {

constexpr std::size_t most_points = 4000;  // per curve; more than a screen shows

// Distinct for every kind of colour vision (Okabe & Ito 2008).
constexpr std::array<const char*, 6> colours{"#0072b2", "#d55e00", "#009e73",
                                             "#cc79a7", "#e69f00", "#56b4e9"};

struct Interval {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  void include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  [[nodiscard]] bool empty() const { return !(high >= low); }
};

bool drawable(double x, double y, bool logarithmic) {
  return std::isfinite(x) && std::isfinite(y) && (!logarithmic || y > 0);
}

/// The curve as a named block of a script. Of a long curve each piece gives its least and its greatest value,
/// so that no peak is lost.
std::string data_block(const Curve& curve, std::size_t number, bool logarithmic) {
  std::string text = fmt::format("$curve{} << END\n", number);
  const std::size_t count = std::min(curve.x.size(), curve.y.size());
  const auto write = [&](std::size_t i) {
    text += drawable(curve.x[i], curve.y[i], logarithmic)
                ? fmt::format("{:.12g} {:.12g}\n", curve.x[i], curve.y[i])
                : "\n";
  };
  if (count <= most_points) {
    for (std::size_t i = 0; i < count; ++i) write(i);
  } else {
    const std::size_t pieces = most_points / 2;
    for (std::size_t piece = 0; piece < pieces; ++piece) {
      const auto begin = curve.y.begin() + static_cast<std::ptrdiff_t>(piece * count / pieces);
      const auto end = curve.y.begin() + static_cast<std::ptrdiff_t>((piece + 1) * count / pieces);
      const auto [least, greatest] = std::minmax_element(begin, end);
      // From a list: of two temporaries minmax would give back references.
      const auto [first, second] = std::minmax({least - curve.y.begin(), greatest - curve.y.begin()});
      write(static_cast<std::size_t>(first));
      if (second != first) write(static_cast<std::size_t>(second));
    }
  }
  return text + "END\n";
}

}  // namespace

void draw_curves(const CurvePlot& plot, const std::filesystem::path& picture, const Gnuplot& gnuplot) {
  Interval x_range;
  Interval y_range;
  std::string script =
      "set border 3 lc rgb '#606060'\nset tics nomirror out scale 0.5\nset grid lc rgb '#e4e4e4' lt 1 lw "
      "0.7\n"
      "set key top right samplen 2 spacing 1.1\n";
  std::string pieces;
  const auto add_piece = [&](const std::string& piece) {
    pieces += (pieces.empty() ? "plot " : ", ") + piece;
  };
  for (std::size_t i = 0; i < plot.curves.size(); ++i) {
    const Curve& curve = plot.curves[i];
    const std::size_t count = std::min(curve.x.size(), curve.y.size());
    std::size_t drawn = 0;
    for (std::size_t k = 0; k < count; ++k) {
      if (!drawable(curve.x[k], curve.y[k], plot.logarithmic)) continue;
      x_range.include(curve.x[k]);
      y_range.include(curve.y[k]);
      ++drawn;
    }
    if (drawn == 0) continue;
    script += data_block(curve, i, plot.logarithmic);
    constexpr std::size_t few = 60;  // so few points are shown one by one
    const auto title = curve.name.empty() ? std::string("notitle") : "title " + Gnuplot::quoted(curve.name);
    add_piece(fmt::format("$curve{} with {} lc rgb '{}' lw 1.8 pt 7 ps 0.35 {}", i,
                          drawn <= few ? "linespoints" : "lines", colours[i % colours.size()], title));
  }
  if (y_range.empty()) throw std::runtime_error("holds no value that can be drawn");
  for (const auto& [name, level] : plot.levels) {
    if (!drawable(0, level, plot.logarithmic)) continue;
    y_range.include(level);
    add_piece(fmt::format("{:.12g} with lines lc rgb '#808080' lw 1.2 dt 2 title {}", level,
                          Gnuplot::quoted(name)));
  }
  // gnuplot warns about (and a logarithmic axis refuses) a range without width.
  if (plot.logarithmic) {
    script += fmt::format("set logscale y\nset format y '1e%T'\nset yrange [{:.6g}:{:.6g}]\n",
                          0.5 * y_range.low, 2 * y_range.high);
  } else {
    const double size = std::max(std::abs(y_range.low), std::abs(y_range.high));
    double margin = 0.06 * (y_range.high - y_range.low);
    if (!(margin > 1e-9 * size)) margin = size > 0 ? 0.05 * size : 1.0;
    script += fmt::format("set yrange [{:.12g}:{:.12g}]\nset format y '%.4g'\n", y_range.low - margin,
                          y_range.high + margin);
  }
  if (!(x_range.high > x_range.low)) {
    const double margin = x_range.high != 0 ? 0.05 * std::abs(x_range.high) : 1.0;
    x_range.low -= margin;
    x_range.high += margin;
  }
  script += fmt::format("set xrange [{:.12g}:{:.12g}]\nset xlabel {}\nset ylabel {}\n", x_range.low,
                        x_range.high, Gnuplot::quoted(plot.x_label), Gnuplot::quoted(plot.y_label));
  gnuplot.draw(picture,
               fmt::format("svg size {},{} font 'Helvetica,Arial,sans-serif,13' background 'white'",
                           plot.width, plot.height),
               script + pieces + "\n");
}

}  // namespace estuary::coupler
