#include "report_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace estuary::coupler {
namespace {

constexpr const char* style = R"(
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; color: #1c2733; background: #fff;
  margin: 0 auto; max-width: 1120px; overflow-wrap: break-word; padding: 24px 28px 60px; }
h1 { font-size: 27px; margin: 0 0 6px; }
h2 { font-size: 19px; margin: 36px 0 10px; padding-bottom: 4px; border-bottom: 1px solid #d9dee4; }
h3 { font-size: 15px; margin: 20px 0 6px; }
.table { overflow-x: auto; }
table { border-collapse: collapse; margin: 8px 0; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 4px 14px 4px 0; border-bottom: 1px solid #e8ecf0; vertical-align: top; }
th { font-weight: 600; color: #51606f; }
td.number { text-align: right; white-space: nowrap; }
.good { color: #08703f; font-weight: 600; }
.bad { color: #b3201a; font-weight: 600; }
p.notice { border-left: 4px solid #9aa7b4; background: #f4f6f8; padding: 8px 12px; margin: 10px 0; font-weight: normal; }
p.notice.good { border-color: #08703f; } p.notice.bad { border-color: #b3201a; }
figure { margin: 12px 0; } figure img { max-width: 100%; height: auto; }
figcaption { color: #51606f; font-size: 13.5px; }
.gallery { display: flex; flex-wrap: wrap; gap: 6px 22px; } .gallery figure { flex: 0 1 480px; margin: 4px 0; }
.bars { display: grid; grid-template-columns: max-content 1fr max-content; gap: 3px 12px; align-items: center; max-width: 760px; }
.bar { background: #0072b2; height: 13px; min-width: 1px; border-radius: 2px; } .bars .value { text-align: right; font-variant-numeric: tabular-nums; }
pre { background: #f4f6f8; padding: 12px; overflow-x: auto; font-size: 13px; line-height: 1.4; }
summary { cursor: pointer; font-weight: 600; }
@media (max-width: 640px) { body { padding: 14px 14px 40px; } h1 { font-size: 22px; } .bars { grid-template-columns: max-content 1fr; }
  .bars .value { grid-column: 2; text-align: left; } figure.wide { overflow-x: auto; } figure.wide img { max-width: none; width: 720px; } }
@media print { body { max-width: none; } }
)";

bool looks_like_number(std::string_view text) {
  return text == "-" ||
         (!text.empty() && text.find_first_not_of("0123456789.eE+-% ") == std::string_view::npos &&
          text.find_first_of("0123456789") != std::string_view::npos);
}

/// Flush right when `number`: a column of numbers lines up, a number among texts does not stand apart.
std::string cell(std::string_view text, bool number) {
  for (const std::string_view kind : {"good", "bad"}) {
    if (text.starts_with(kind) && text.substr(kind.size()).starts_with(":")) {
      return fmt::format("<td><span class=\"{}\">{}</span></td>", kind,
                         html_escaped(text.substr(kind.size() + 1)));
    }
  }
  return fmt::format("<td{}>{}</td>", number ? " class=\"number\"" : "", html_escaped(text));
}

}  // namespace

std::string html_escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      case '\'':
        result += "&#39;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string result;
  result.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = (group << 8U) | (k < count ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      result += k <= count ? alphabet[(group >> (18U - 6U * k)) & 63U] : '=';
    }
  }
  return result;
}

ReportPage::ReportPage(const std::string& title) : title_(title) {
  body_ = fmt::format("<h1>{}</h1>\n", html_escaped(title));
}

void ReportPage::heading(const std::string& text) {
  body_ += fmt::format("<h2>{}</h2>\n", html_escaped(text));
}

void ReportPage::subheading(const std::string& text) {
  body_ += fmt::format("<h3>{}</h3>\n", html_escaped(text));
}

void ReportPage::paragraph(const std::string& text) {
  body_ += fmt::format("<p>{}</p>\n", html_escaped(text));
}

void ReportPage::notice(const std::string& kind, const std::string& text) {
  body_ += fmt::format("<p class=\"notice {}\">{}</p>\n", html_escaped(kind), html_escaped(text));
}

void ReportPage::list(const std::vector<std::string>& entries) {
  body_ += "<ul>\n";
  for (const auto& entry : entries) body_ += fmt::format("<li>{}</li>\n", html_escaped(entry));
  body_ += "</ul>\n";
}

void ReportPage::table(const std::vector<std::string>& names,
                       const std::vector<std::vector<std::string>>& rows) {
  const auto is_number = [&](std::size_t column) {
    return std::all_of(rows.begin(), rows.end(), [&](const auto& row) {
      return column >= row.size() || row[column].empty() || row[column] == "-" ||
             looks_like_number(row[column]);
    });
  };
  std::vector<bool> numbers;
  body_ += "<div class=\"table\"><table>\n<tr>";
  for (const auto& name : names) {
    numbers.push_back(is_number(numbers.size()));
    body_ += fmt::format("<th{}>{}</th>", numbers.back() ? " class=\"number\"" : "", html_escaped(name));
  }
  body_ += "</tr>\n";
  for (const auto& row : rows) {
    body_ += "<tr>";
    for (std::size_t column = 0; column < row.size(); ++column)
      body_ += cell(row[column], column < numbers.size() && numbers[column]);
    body_ += "</tr>\n";
  }
  body_ += "</table></div>\n";
}

void ReportPage::bars(const std::vector<std::pair<std::string, double>>& values, double whole,
                      const std::string& unit) {
  body_ += "<div class=\"bars\">\n";
  for (const auto& [name, value] : values) {
    const double share = whole > 0 ? std::clamp(value / whole, 0.0, 1.0) : 0.0;
    body_ += fmt::format(
        "<span>{}</span><span><span class=\"bar\" style=\"display:block;width:{:.2f}%\"></span></span>"
        "<span class=\"value\">{:.3f} {} ({:.1f} %)</span>\n",
        html_escaped(name), 100 * share, value, html_escaped(unit), 100 * share);
  }
  body_ += "</div>\n";
}

void ReportPage::picture(const std::filesystem::path& file, const std::string& caption, bool wide) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream content;
  content << stream.rdbuf();
  if (!stream || content.str().empty())
    throw std::runtime_error(fmt::format("{}: cannot be read", file.string()));
  const char* kind = file.extension() == ".svg" ? "image/svg+xml" : "image/png";
  body_ += fmt::format(
      "<figure{}><img alt=\"{}\" src=\"data:{};base64,{}\"><figcaption>{}</figcaption></figure>\n",
      wide ? " class=\"wide\"" : "", html_escaped(caption), kind, base64(content.str()),
      html_escaped(caption));
}

void ReportPage::begin_gallery() {
  body_ += "<div class=\"gallery\">\n";
}

void ReportPage::end_gallery() {
  body_ += "</div>\n";
}

void ReportPage::folded(const std::string& title, const std::string& text) {
  body_ += fmt::format("<details><summary>{}</summary><pre>{}</pre></details>\n", html_escaped(title),
                       html_escaped(text));
}

std::string ReportPage::html() const {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, "
      "initial-scale=1\">\n<title>{}</title>\n<style>{}</style>\n"
      "</head>\n<body>\n{}</body>\n</html>\n",
      html_escaped(title_), style, body_);
}

}  // namespace estuary::coupler
