// Builds an HTML page that needs nothing but itself: text is escaped, pictures are embedded.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace estuary::coupler {

/// `text` with the characters that HTML reads as markup replaced.
std::string html_escaped(std::string_view text);

/// RFC 4648, section 4.
std::string base64(std::string_view bytes);

class ReportPage {
public:
  explicit ReportPage(const std::string& title);

  void heading(const std::string& text);
  void subheading(const std::string& text);
  void paragraph(const std::string& text);
  /// A paragraph that stands out: `kind` is "good", "bad" or "note".
  void notice(const std::string& kind, const std::string& text);
  void list(const std::vector<std::string>& entries);
  /// A row per entry of `rows`; an entry beginning with "good:" or "bad:" is coloured and shown without that
  /// word. Columns of numbers are set flush right.
  void table(const std::vector<std::string>& names, const std::vector<std::vector<std::string>>& rows);
  /// Bars of `values`, each as a share of `whole`, with a number.
  void bars(const std::vector<std::pair<std::string, double>>& values, double whole, const std::string& unit);
  /// PNG or SVG, by its ending. Throws std::runtime_error when it cannot be read.
  void picture(const std::filesystem::path& file, const std::string& caption, bool wide);
  /// Pictures side by side.
  void begin_gallery();
  void end_gallery();
  /// Text as it is, folded away under `title`.
  void folded(const std::string& title, const std::string& text);

  [[nodiscard]] std::string html() const;

private:
  std::string title_;
  std::string body_;
};

}  // namespace estuary::coupler
