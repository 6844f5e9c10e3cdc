// Every speed the room's README states, in one table: medians of interleaved runs, with one thread and with
// two, next to what the memory of this machine gives in the same runs.
//
//   fluid_speed_table [--runs 5] [--seconds 0.3] [--threads 2] [--only TEXT]
//
// An update of a node reads and writes its populations in place: 144 bytes in the plane in double precision,
// 304 in space, half in single precision. The memory's limit is an in-place update of an array of 512 MiB. A
// grid that fits into the last-level cache may exceed it. Where other programs use the processors, the
// updates per second of processor time (second column of figures) tell more than those of the clock.
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "speed_cases.hpp"

namespace {

using namespace estuary::fluid;

struct Sample {
  double per_second = 0;            // of the clock
  double per_processor_second = 0;  // of all threads together, times their number
};

struct Row {
  std::string name;
  double bytes = 0;  // per update
  double share = 1;  // of nodes that are fluid
  std::function<void()> step;
  double updates = 0;  // of one call
  std::vector<Sample> samples;
};

double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

double median(const Row& row, double Sample::*member) {
  std::vector<double> values;
  for (const Sample& sample : row.samples) values.push_back(sample.*member);
  return median_of(std::move(values));
}

/// Calls `row.step` for about `seconds` after one call to warm the caches.
void measure(Row& row, double seconds, int threads) {
  row.step();
  const double begin = omp_get_wtime();
  const std::clock_t processor_begin = std::clock();
  double updates = 0;
  double elapsed = 0;
  do {
    row.step();
    updates += row.updates;
    elapsed = omp_get_wtime() - begin;
  } while (elapsed < seconds);
  const double processor = static_cast<double>(std::clock() - processor_begin) / CLOCKS_PER_SEC;
  row.samples.push_back({updates / elapsed, updates * threads / processor});
}

Row row_of(std::string name, const std::shared_ptr<speed::Case>& flow) {
  Row row;
  row.name = std::move(name);
  row.bytes = flow->flow.bytes_per_update();
  const double nodes = static_cast<double>(flow->flow.cells().fluid_count());
  row.share = nodes / static_cast<double>(flow->flow.grid().size());
  const int steps = std::max(2, static_cast<int>(2e6 / nodes) / 2 * 2);
  row.updates = nodes * steps;
  row.step = [flow, steps] { flow->run(steps); };
  return row;
}

Row bandwidth_row() {
  Row row;
  row.name = "in-place update of 512 MiB";
  row.bytes = 2 * sizeof(double);
  constexpr std::ptrdiff_t size = (std::ptrdiff_t{512} << 20) / static_cast<std::ptrdiff_t>(sizeof(double));
  const std::shared_ptr<std::vector<double>> array = std::make_shared<std::vector<double>>(size, 1.0);
  row.updates = static_cast<double>(size);
  row.step = [array] {
    double* const values = array->data();
    const auto count = static_cast<std::ptrdiff_t>(array->size());
#pragma omp parallel for simd schedule(static)
    for (std::ptrdiff_t n = 0; n < count; ++n) values[n] = 0.5 * values[n] + 0.5;
  };
  return row;
}

std::vector<Row> all_rows(const std::string& only) {
  std::vector<Row> rows{bandwidth_row()};
  for (const auto& [name, make] : speed::cases()) {
    if (name.find(only) != std::string::npos) rows.push_back(row_of(name, make()));
  }
  return rows;
}

void print(const std::vector<Row>& rows, int threads) {
  const double limit = median(rows.front(), &Sample::per_second) * rows.front().bytes;
  std::printf("\n%d thread%s, in-place bandwidth %.1f GB/s; medians of %zu interleaved runs\n", threads,
              threads == 1 ? "" : "s", limit * 1e-9, rows.front().samples.size());
  std::printf("%-44s %12s %22s %8s %12s\n", "case", "M updates/s", "per processor second", "bytes",
              "% of limit");
  for (std::size_t n = 1; n < rows.size(); ++n) {
    const Row& row = rows[n];
    const double speed = median(row, &Sample::per_second);
    std::printf("%-44s %12.0f %22.0f %8.0f %12.0f\n", row.name.c_str(), speed * 1e-6,
                median(row, &Sample::per_processor_second) * 1e-6, row.bytes,
                100 * speed * row.bytes / limit);
  }
}

// Of two cases, run by run.
void print_ratio(const std::vector<Row>& rows, const std::string& a, const std::string& b,
                 const char* meaning) {
  const auto find = [&](const std::string& name) {
    return std::find_if(rows.begin(), rows.end(), [&](const Row& row) { return row.name == name; });
  };
  const auto one = find(a);
  const auto other = find(b);
  if (one == rows.end() || other == rows.end()) return;
  std::vector<double> by_clock;
  std::vector<double> by_processor;
  for (std::size_t n = 0; n < one->samples.size(); ++n) {
    by_clock.push_back(one->samples[n].per_second / other->samples[n].per_second);
    by_processor.push_back(one->samples[n].per_processor_second / other->samples[n].per_processor_second);
  }
  std::printf("%-78s %6.2f %6.2f\n", meaning, median_of(by_clock), median_of(by_processor));
}

}  // namespace

int main(int count, char** arguments) {
  int runs = 5;
  double seconds = 0.3;
  int most_threads = 2;
  std::string only;
  for (int n = 1; n + 1 < count; n += 2) {
    const std::string key = arguments[n];
    if (key == "--runs") runs = std::max(1, std::atoi(arguments[n + 1]));
    if (key == "--seconds") seconds = std::atof(arguments[n + 1]);
    if (key == "--threads") most_threads = std::max(1, std::atoi(arguments[n + 1]));
    if (key == "--only") only = arguments[n + 1];
  }
  std::vector<Row> rows = all_rows(only);
  for (int threads = 1; threads <= most_threads; ++threads) {
    omp_set_num_threads(threads);
    for (Row& row : rows) row.samples.clear();
    for (int run = 0; run < runs; ++run) {
      for (Row& row : rows) measure(row, seconds, threads);
    }
    print(rows, threads);
    std::printf("\n%-78s %6s %6s\n", "ratios, medians of the runs' own", "clock", "proc.");
    for (const speed::Ratio& ratio : speed::ratios())
      print_ratio(rows, ratio.one, ratio.other, ratio.meaning);
  }
  return 0;
}
