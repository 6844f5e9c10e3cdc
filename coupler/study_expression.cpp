#include "study_expression.hpp"

#include <fmt/format.h>
#include <muParser.h>

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

namespace estuary::coupler {

double evaluate_expression(const std::string& text, const std::map<std::string, double>& variables) {
  double value = 0;
  try {
    mu::Parser parser;
    parser.DefineConst("pi", std::numbers::pi);
    for (const auto& [name, number] : variables) parser.DefineConst(name, number);
    parser.SetExpr(text);
    value = parser.Eval();
  } catch (const mu::Parser::exception_type& error) {
    std::vector<std::string> known;
    for (const auto& [name, number] : variables) known.push_back(name);
    throw std::invalid_argument(
        fmt::format("'{}': {}; known are {} and pi", text, error.GetMsg(), fmt::join(known, ", ")));
  }
  if (!std::isfinite(value)) throw std::invalid_argument(fmt::format("'{}' is {}", text, value));
  return value;
}

}  // namespace estuary::coupler
