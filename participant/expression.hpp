// Expressions of x, y, z and t in a scene (profiles, ramps), evaluated with muParser.
#pragma once

#include <memory>
#include <string>

namespace estuary {

/// Not safe to share between threads, not even for evaluation only: one per thread.
class Expression {
public:
  /// Throws std::invalid_argument with muParser's message and position when the text is not an expression.
  explicit Expression(const std::string& text);
  ~Expression();
  Expression(Expression&&) noexcept;
  Expression& operator=(Expression&&) noexcept;

  [[nodiscard]] double operator()(double x, double y, double z, double t) const;
  /// True when the value does not depend on t.
  [[nodiscard]] bool constant_in_time() const;
  [[nodiscard]] const std::string& text() const;

private:
  struct Parser;
  std::unique_ptr<Parser> parser_;
};

}  // namespace estuary
