// A state as one list of numbers, read in the order written; what is kept of an object for a checkpoint.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <stdexcept>
#include <vector>

namespace estuary::coupler {

class StateWriter {
public:
  void number(double value) { values_.push_back(value); }
  void count(std::size_t value) { number(static_cast<double>(value)); }
  /// Its length and its values.
  void list(std::span<const double> values) {
    count(values.size());
    values_.insert(values_.end(), values.begin(), values.end());
  }
  [[nodiscard]] const std::vector<double>& values() const { return values_; }

private:
  std::vector<double> values_;
};

/// Throws std::runtime_error where the list has something else than what is asked for.
class StateReader {
public:
  explicit StateReader(std::span<const double> values) : rest_(values) {}
  double number() {
    require(1);
    const double value = rest_.front();
    rest_ = rest_.subspan(1);
    return value;
  }
  std::size_t count() {
    constexpr double largest_exact = 9007199254740992.0;  // 2^53
    const double value = number();
    if (!(value >= 0 && value <= largest_exact) || value != std::floor(value))
      throw std::runtime_error("a count is no whole number");
    return static_cast<std::size_t>(value);
  }
  /// Of things that take one number each or more, so that no more memory is asked for than the list has.
  std::size_t count_of_entries() {
    const std::size_t entries = count();
    require(entries);
    return entries;
  }
  std::vector<double> list() {
    const std::size_t size = count_of_entries();
    std::vector<double> values(rest_.begin(), rest_.begin() + static_cast<std::ptrdiff_t>(size));
    rest_ = rest_.subspan(size);
    return values;
  }
  void require_end() const {
    if (!rest_.empty()) throw std::runtime_error("there is more than was asked for");
  }

private:
  void require(std::size_t size) const {
    if (rest_.size() < size) throw std::runtime_error("it ends early");
  }
  std::span<const double> rest_;
};

}  // namespace estuary::coupler
