#include "quasi_newton.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace estuary::coupler {
namespace {

// Changes below this share of the answer are rounding.
constexpr double round_off = 1e-11;

// In several sums at a time: one alone waits for each addition, which takes longer than a pass over a column.
double norm_of(std::span<const double> values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size())).norm();
}

// `before` becomes its change to `now`.
void to_change(std::vector<double>& before, std::span<const double> now) {
  for (std::size_t i = 0; i < now.size(); ++i) before[i] = now[i] - before[i];
}

// `answer` + W c, less what is not wanted of the residual's part outside V, which is minus `right`.
void take_step(const std::vector<double>& answer, const std::vector<double>& right, double remainder,
               std::span<double> iterate) {
  for (std::size_t i = 0; i < iterate.size(); ++i) iterate[i] = answer[i] + (1 - remainder) * right[i];
}

// One field as long as the iterate unless the settings say otherwise.
std::vector<std::size_t> fields_for(const std::vector<std::size_t>& fields, std::size_t size) {
  return fields.empty() ? std::vector<std::size_t>{size} : fields;
}

}  // namespace

ResidualSum::ResidualSum(std::vector<std::size_t> fields)
    : fields_(std::move(fields)),
      sums_(fields_.size(), 0.0),
      weights_(std::max<std::size_t>(1, fields_.size()), 1.0) {}

void ResidualSum::begin_window() {
  std::fill(sums_.begin(), sums_.end(), 0.0);
}

void ResidualSum::add(std::span<const double> residual) {
  if (fields_.empty()) return;
  const double whole = norm_of(residual);
  if (!(whole > 0)) return;
  std::size_t begin = 0;
  for (std::size_t k = 0; k < fields_.size(); ++k) {
    sums_[k] += norm_of(residual.subspan(begin, fields_[k])) / whole;
    // A field that has not changed yet keeps its last weight.
    if (sums_[k] > 0) weights_[k] = 1 / sums_[k];
    begin += fields_[k];
  }
}

// A column comes from memory, what it is multiplied with stays in the cache: one pass for all.
template <std::size_t Count>
void ColumnPairs::multiply(const std::vector<double>& column,
                           const std::array<std::span<const double>, Count>& others,
                           const std::array<std::vector<double>*, Count>& products) const {
  constexpr std::size_t piece = 1024;
  std::size_t begin = 0;
  for (std::size_t field = 0; field < fields_.size(); ++field) {
    const std::size_t end = begin + fields_[field];
    for (; begin < end; begin += piece) {
      const auto length = static_cast<Eigen::Index>(std::min(piece, end - begin));
      const Eigen::Map<const Eigen::VectorXd> values(column.data() + begin, length);
      for (std::size_t k = 0; k < Count; ++k)
        (*products[k])[field] +=
            values.dot(Eigen::Map<const Eigen::VectorXd>(others[k].data() + begin, length));
    }
    begin = end;
  }
}

void ColumnPairs::push_front(std::vector<double> residual_change, std::vector<double> answer_change,
                             std::span<const double> right, ReadingTeam& team) {
  pairs_.push_front({std::move(residual_change), std::move(answer_change), {}, {}});
  Pair& newest = pairs_.front();
  newest.products.assign(pairs_.size(), std::vector<double>(fields_.size(), 0.0));
  for (Pair& pair : pairs_) pair.projection.assign(fields_.size(), 0.0);
  team.for_each(pairs_.size(), pairs_.size() * right.size(), [&](std::size_t k) {
    multiply<2>(pairs_[k].residual_change, {newest.residual_change, right},
                {&newest.products[k], &pairs_[k].projection});
  });
  projected_ = true;
}

void ColumnPairs::project(std::span<const double> right, ReadingTeam& team) {
  for (Pair& pair : pairs_) pair.projection.assign(fields_.size(), 0.0);
  team.for_each(pairs_.size(), pairs_.size() * right.size(), [&](std::size_t k) {
    multiply<1>(pairs_[k].residual_change, {right}, {&pairs_[k].projection});
  });
}

void ColumnPairs::resize(std::size_t count, std::vector<std::vector<double>>& spare) {
  while (pairs_.size() > count) {
    spare.push_back(std::move(pairs_.back().residual_change));
    spare.push_back(std::move(pairs_.back().answer_change));
    pairs_.pop_back();
    for (Pair& pair : pairs_) pair.products.pop_back();
  }
}

double ColumnPairs::product(std::size_t newer, std::size_t older, const std::vector<double>& weights) const {
  const auto& products = pairs_[newer].products[older - newer];
  double sum = 0;
  for (std::size_t k = 0; k < products.size(); ++k) sum += weights[k] * weights[k] * products[k];
  return sum;
}

// Cholesky factorisation of the columns' products, newest first; a column stays when enough of it is
// independent of the newer ones. The factor is lower triangular.
std::vector<std::size_t> ColumnPairs::choose(const QuasiNewtonSettings& settings,
                                             const std::vector<double>& weights, double smallest,
                                             ColumnFilter filter, Eigen::MatrixXd& triangle) const {
  // Below this share of itself a column's independent part is rounding of the products.
  constexpr double least_part = 1e-7;
  std::vector<std::size_t> chosen;
  const std::size_t most =
      std::min({pairs_.size(), settings.most_columns, pairs_.front().residual_change.size()});
  triangle.setZero(static_cast<Eigen::Index>(most), static_cast<Eigen::Index>(most));
  double square_of_factor = 0;
  for (std::size_t column = 0; column < pairs_.size() && chosen.size() < most; ++column) {
    const double square = product(column, column, weights);
    if (!(std::sqrt(square) > smallest)) continue;
    const auto next = static_cast<Eigen::Index>(chosen.size());
    double rest = square;
    for (Eigen::Index k = 0; k < next; ++k) {
      double value = product(chosen[static_cast<std::size_t>(k)], column, weights);
      value -= triangle.row(k).head(k).dot(triangle.row(next).head(k));
      triangle(next, k) = value / triangle(k, k);
      rest -= triangle(next, k) * triangle(next, k);
    }
    const double limit = filter == ColumnFilter::qr2 ? settings.filter_limit * settings.filter_limit * square
                         : filter == ColumnFilter::qr1
                             ? settings.filter_limit * settings.filter_limit * square_of_factor
                             : 0.0;
    if (!(rest > std::max(limit, least_part * least_part * square))) {
      triangle.row(next).setZero();
      continue;
    }
    triangle(next, next) = std::sqrt(rest);
    square_of_factor += square;
    chosen.push_back(column);
  }
  return chosen;
}

std::size_t ColumnPairs::apply(std::span<double> right, std::span<double> answer,
                               const std::vector<double>& weights, const QuasiNewtonSettings& settings,
                               double smallest, Rest rest, ReadingTeam& team) {
  if (pairs_.empty()) return 0;
  if (!std::exchange(projected_, false)) project(right, team);
  Eigen::MatrixXd triangle;
  std::vector<std::size_t> chosen;
  if (settings.filter == ColumnFilter::qr3) {
    const auto everything = choose(settings, weights, smallest, ColumnFilter::none, triangle);
    chosen = choose(settings, weights, smallest, ColumnFilter::qr1, triangle);
    if (chosen.size() < everything.size())
      chosen = choose(settings, weights, smallest, ColumnFilter::qr2, triangle);
  } else {
    chosen = choose(settings, weights, smallest, settings.filter, triangle);
  }
  const auto count = static_cast<Eigen::Index>(chosen.size());
  if (count == 0) return 0;
  Eigen::VectorXd projected(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const auto& projection = pairs_[chosen[static_cast<std::size_t>(k)]].projection;
    projected[k] = 0;
    for (std::size_t field = 0; field < fields_.size(); ++field)
      projected[k] += weights[field] * weights[field] * projection[field];
  }
  const auto lower = triangle.topLeftCorner(count, count).triangularView<Eigen::Lower>();
  lower.solveInPlace(projected);
  lower.transpose().solveInPlace(projected);
  add_columns(chosen, projected, &Pair::answer_change, answer, team);
  if (rest == Rest::needed) {
    projected = -projected;
    add_columns(chosen, projected, &Pair::residual_change, right, team);
  }
  return chosen.size();
}

// `sum` += columns times factors, in the order of the columns. Piece by piece, so that what is added to stays
// in the cache while the columns, which are many times longer than any cache, come from memory once; four at
// a time, so that several are under way.
void ColumnPairs::add_columns(const std::vector<std::size_t>& chosen, const Eigen::VectorXd& factors,
                              std::vector<double> Pair::*column, std::span<double> sum,
                              ReadingTeam& team) const {
  constexpr std::size_t piece = 2048;
  team.for_each((sum.size() + piece - 1) / piece, chosen.size() * sum.size(), [&](std::size_t number) {
    const std::size_t begin = number * piece;
    const std::size_t length = std::min(piece, sum.size() - begin);
    double* part = sum.data() + begin;
    const auto factor = [&](std::size_t k) { return factors[static_cast<Eigen::Index>(k)]; };
    const auto values = [&](std::size_t k) { return (pairs_[chosen[k]].*column).data() + begin; };
    std::size_t k = 0;
    for (; k + 4 <= chosen.size(); k += 4) {
      const double f0 = factor(k), f1 = factor(k + 1), f2 = factor(k + 2), f3 = factor(k + 3);
      const double *v0 = values(k), *v1 = values(k + 1), *v2 = values(k + 2), *v3 = values(k + 3);
      for (std::size_t i = 0; i < length; ++i)
        part[i] = (((part[i] + f0 * v0[i]) + f1 * v1[i]) + f2 * v2[i]) + f3 * v3[i];
    }
    for (; k < chosen.size(); ++k) {
      const double f = factor(k);
      const double* v = values(k);
      for (std::size_t i = 0; i < length; ++i) part[i] += f * v[i];
    }
  });
}

void ColumnPairs::save(StateWriter& state) const {
  state.count(pairs_.size());
  for (const Pair& pair : pairs_) {
    state.list(pair.residual_change);
    state.list(pair.answer_change);
    for (const auto& product : pair.products) state.list(product);
  }
}

void ColumnPairs::load(StateReader& state) {
  pairs_.resize(state.count_of_entries());
  const std::size_t size = std::accumulate(fields_.begin(), fields_.end(), std::size_t{0});
  for (std::size_t k = 0; k < pairs_.size(); ++k) {
    Pair& pair = pairs_[k];
    pair.residual_change = state.list();
    pair.answer_change = state.list();
    bool fits = pair.residual_change.size() == size && pair.answer_change.size() == size;
    pair.products.resize(pairs_.size() - k);
    for (auto& product : pair.products) {
      product = state.list();
      fits = fits && product.size() == fields_.size();
    }
    if (!fits) throw std::runtime_error("a column has another length");
  }
}

QuasiNewton::QuasiNewton(QuasiNewtonSettings settings)
    : settings_(std::move(settings)),
      factor_(settings_.relaxation),
      team_(settings_.threads),
      weights_(settings_.fields) {}

void QuasiNewton::begin_window() {
  last_residual_.clear();
  last_answer_.clear();
  weights_.begin_window();
}

void QuasiNewton::forget() {
  problems_.clear();
  QuasiNewton::begin_window();
}

void QuasiNewton::update(std::span<const double> residual, std::span<double> iterate) {
  const auto fields = fields_for(settings_.fields, iterate.size());
  if (problems_.empty()) problems_.emplace_front(fields);
  if (problems_.front().count() == 0) problems_.front() = ColumnPairs(fields);
  for (const ColumnPairs& problem : problems_) {
    if (problem.count() > 0 && problem.fields() != fields)
      throw std::runtime_error("what the acceleration has learnt belongs to another wet surface");
  }
  // Memory is used again, that of dropped columns too: vectors as long as the wet surface would otherwise be
  // asked of the system and given back at each iteration.
  answer_.resize(residual.size());
  right_.resize(residual.size());
  for (std::size_t i = 0; i < residual.size(); ++i) {
    answer_[i] = iterate[i] + residual[i];
    right_[i] = -residual[i];
  }
  if (!last_residual_.empty()) {
    to_change(last_residual_, residual);
    to_change(last_answer_, answer_);
    problems_.front().push_front(std::move(last_residual_), std::move(last_answer_), right_, team_);
    for (std::vector<double>* last : {&last_residual_, &last_answer_}) {
      if (spare_.empty()) break;
      *last = std::move(spare_.back());
      spare_.pop_back();
    }
  }
  last_residual_.assign(residual.begin(), residual.end());
  last_answer_.assign(answer_.begin(), answer_.end());
  weights_.add(residual);

  const double smallest = round_off * norm_of(last_answer_);
  columns_used_ = 0;
  for (ColumnPairs& problem : problems_) {
    const bool last = &problem == &problems_.back() && settings_.remainder == 1;
    columns_used_ += problem.apply(right_, answer_, weights_.weights(), settings_, smallest,
                                   last ? ColumnPairs::Rest::unused : ColumnPairs::Rest::needed, team_);
  }
  if (columns_used_ == 0) {
    factor_ = settings_.relaxation;
    relax(factor_, residual, iterate);
    return;
  }
  factor_ = 1;
  take_step(answer_, right_, settings_.remainder, iterate);
}

void QuasiNewton::save(StateWriter& state) const {
  state.list(weights_.weights());
  state.count(problems_.size());
  for (const ColumnPairs& problem : problems_) {
    std::vector<double> fields;
    for (const std::size_t length : problem.fields()) fields.push_back(static_cast<double>(length));
    state.list(fields);
    problem.save(state);
  }
}

void QuasiNewton::load(StateReader& state) {
  QuasiNewton::forget();
  std::vector<double> weights = state.list();
  if (weights.size() != weights_.weights().size()) throw std::runtime_error("another number of weights");
  weights_.set_weights(std::move(weights));
  for (std::size_t left = state.count_of_entries(); left > 0; --left) {
    std::vector<std::size_t> fields(state.count_of_entries());
    for (std::size_t& length : fields) length = state.count();
    problems_.emplace_back(std::move(fields)).load(state);
  }
}

void InterfaceQuasiNewton::save(StateWriter& state) const {
  QuasiNewton::save(state);
  state.count(columns_of_window_.size());
  for (const std::size_t columns : columns_of_window_) state.count(columns);
}

void InterfaceQuasiNewton::load(StateReader& state) {
  QuasiNewton::load(state);
  columns_of_window_.resize(state.count_of_entries());
  std::size_t left = problems_.empty() ? 0 : problems_.front().count();
  for (std::size_t& columns : columns_of_window_) {
    columns = state.count();
    if (columns > left) throw std::runtime_error("windows with more columns than there are");
    left -= columns;
  }
}

void InterfaceQuasiNewton::begin_window() {
  QuasiNewton::begin_window();
  if (problems_.empty()) return;
  const auto past = std::accumulate(columns_of_window_.begin(), columns_of_window_.end(), std::size_t{0});
  const std::size_t columns = problems_.front().count() - past;
  if (columns > 0) columns_of_window_.push_front(columns);
  while (columns_of_window_.size() > settings_.windows_reused) columns_of_window_.pop_back();
  problems_.front().resize(
      std::accumulate(columns_of_window_.begin(), columns_of_window_.end(), std::size_t{0}), spare_);
}

void InterfaceQuasiNewton::forget() {
  columns_of_window_.clear();
  QuasiNewton::forget();
}

void MultiVectorQuasiNewton::begin_window() {
  QuasiNewton::begin_window();
  if (!problems_.empty() && problems_.front().count() > 0)
    problems_.emplace_front(fields_for(settings_.fields, 0));
  while (problems_.size() > settings_.windows_reused + 1) {
    problems_.back().resize(0, spare_);
    problems_.pop_back();
  }
}

}  // namespace estuary::coupler
