#pragma once

#include <string>
#include <vector>

namespace leap_object_tracker {

/// One curve; y values that are not finite leave a hole.
struct PlotSeries {
  std::string label;
  std::vector<double> y;
};

/// Curves over one common x.
struct Plot {
  enum class Kind { kLines, kPoints, kBars };
  std::string title;
  std::string x_label;
  std::string y_label;
  std::vector<double> x;
  std::vector<PlotSeries> series;
  Kind kind = Kind::kLines;
  bool log_y = false;
};

/// Curves with their own x each, for Plot: the union of the x, holes elsewhere.
/// @throw std::invalid_argument if a curve has not as many x as y.
void addCurve(Plot& plot, const std::string& label, const std::vector<double>& x,
              const std::vector<double>& y);

/// How many values fall into each of `bins` equal intervals of low to high; x are their centres.
Plot histogram(const std::vector<double>& values, double low, double high, int bins);

/// A report that is one file: style, chart library, data and pictures are all inside.
class HtmlPage {
 public:
  explicit HtmlPage(const std::string& title);

  void addHeading(const std::string& text);
  void addText(const std::string& text);
  /// @throw std::invalid_argument if a row has not as many cells as there are headings.
  void addTable(const std::vector<std::string>& headings,
                const std::vector<std::vector<std::string>>& rows);
  /// @throw std::invalid_argument if a series has not as many values as x.
  void addPlot(const Plot& plot);
  /// @throw std::runtime_error naming a file that cannot be read or is neither PNG nor JPEG.
  void addPicture(const std::string& path, const std::string& caption);

  /// @throw std::runtime_error naming the file.
  void write(const std::string& path) const;

 private:
  std::string title_;
  std::string body_;
  int plots_ = 0;
};

}  // namespace leap_object_tracker
