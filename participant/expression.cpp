#include "expression.hpp"

#include <fmt/format.h>
#include <muParser.h>

#include <mutex>
#include <numbers>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace estuary {

struct Expression::Parser {
  std::string text;
  double x = 0;
  double y = 0;
  double z = 0;
  double t = 0;
  bool constant_in_time = true;
  mu::Parser muparser;
};

namespace {

/// muParser would let an expression assign to its variables; an expression of a scene is a value.
std::size_t assignment_position(std::string_view text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '=') continue;
    const char before = i > 0 ? text[i - 1] : ' ';
    if (i + 1 < text.size() && text[i + 1] == '=') {
      ++i;
    } else if (before != '<' && before != '>' && before != '!') {
      return i;
    }
  }
  return std::string_view::npos;
}

[[noreturn]] void refuse(const std::string& text, const std::string& why, std::size_t position) {
  throw std::invalid_argument(
      fmt::format("expression \"{}\": {} (at character {})", text, why, position + 1));
}

}  // namespace

Expression::Expression(const std::string& text) : parser_(std::make_unique<Parser>()) {
  parser_->text = text;
  if (const auto position = assignment_position(text); position != std::string_view::npos) {
    refuse(text, "'=' is no operation of an expression; compare with '=='", position);
  }
  // All parsers share one std::locale, whose cache libstdc++ fills without a lock when it first reads a
  // number.
  static std::mutex reading;
  const std::lock_guard one_at_a_time(reading);
  try {
    mu::Parser& muparser = parser_->muparser;
    muparser.DefineVar("x", &parser_->x);
    muparser.DefineVar("y", &parser_->y);
    muparser.DefineVar("z", &parser_->z);
    muparser.DefineVar("t", &parser_->t);
    muparser.DefineConst("pi", std::numbers::pi);
    muparser.SetExpr(text);
    muparser.Eval();  // compiles the text; every error of it shows here
    if (muparser.GetNumResults() != 1) {
      refuse(text, fmt::format("gives {} values; expected one", muparser.GetNumResults()), 0);
    }
    parser_->constant_in_time = !muparser.GetUsedVar().contains("t");
  } catch (const mu::Parser::exception_type& error) {
    std::string why = error.GetMsg();
    while (!why.empty() && (why.back() == '.' || why.back() == ' ')) why.pop_back();
    refuse(text, why + "; known are x, y, z, t, pi and muParser's functions", error.GetPos());
  }
}

Expression::~Expression() = default;
Expression::Expression(Expression&&) noexcept = default;
Expression& Expression::operator=(Expression&&) noexcept = default;

double Expression::operator()(double x, double y, double z, double t) const {
  parser_->x = x;
  parser_->y = y;
  parser_->z = z;
  parser_->t = t;
  return parser_->muparser.Eval();
}

bool Expression::constant_in_time() const {
  return parser_->constant_in_time;
}

const std::string& Expression::text() const {
  return parser_->text;
}

}  // namespace estuary
