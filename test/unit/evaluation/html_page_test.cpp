#include "leap_object_tracker/evaluation/html_page.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>

namespace leap_object_tracker {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

std::string written(const HtmlPage& page) {
  const std::string path = testing::TempDir() + "page.html";
  page.write(path);
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  std::remove(path.c_str());
  return text;
}

TEST(HtmlPage, carriesItsChartLibraryAndAsksNoServer) {
  HtmlPage page("A report");
  Plot plot;
  plot.x = {0, 1};
  plot.series = {{"error", {2.5, NAN}}};
  page.addPlot(plot);
  const std::string text = written(page);
  EXPECT_THAT(text, HasSubstr("uPlot=function"));
  EXPECT_THAT(text, HasSubstr("data:[[0,1],[2.5,null]]"));
  EXPECT_THAT(text, Not(HasSubstr("<script src")));
  EXPECT_THAT(text, Not(HasSubstr("<link")));
}

TEST(HtmlPage, showsTextAsTextWhateverItHolds) {
  HtmlPage page("a < b & c");
  page.addTable({"name"}, {{"</td><script>"}});
  Plot plot;
  plot.title = "</script>\"";
  page.addPlot(plot);
  const std::string text = written(page);
  EXPECT_THAT(text, HasSubstr("<h1>a &lt; b &amp; c</h1>"));
  EXPECT_THAT(text, HasSubstr("&lt;/td&gt;&lt;script&gt;"));
  EXPECT_THAT(text, HasSubstr("\\u003c/script>\\\""));
}

TEST(HtmlPage, embedsPicturesAsBase64) {
  const std::string path = testing::TempDir() + "picture.png";
  std::ofstream(path) << "\x89PNG!";
  HtmlPage page("pictures");
  page.addPicture(path, "a dot");
  std::remove(path.c_str());
  EXPECT_THAT(written(page), HasSubstr("data:image/png;base64,iVBORyE="));
}

TEST(HtmlPage, refusesAPictureOfAnotherKind) {
  const std::string path = testing::TempDir() + "picture.txt";
  std::ofstream(path) << "hello";
  HtmlPage page("pictures");
  EXPECT_THROW(page.addPicture(path, ""), std::runtime_error);
  std::remove(path.c_str());
  EXPECT_THROW(page.addPicture(path, ""), std::runtime_error);
}

TEST(HtmlPage, refusesRowsAndSeriesOfTheWrongLength) {
  HtmlPage page("wrong");
  EXPECT_THROW(page.addTable({"a", "b"}, {{"1"}}), std::invalid_argument);
  Plot plot;
  plot.x = {0, 1};
  plot.series = {{"short", {1}}};
  EXPECT_THROW(page.addPlot(plot), std::invalid_argument);
}

TEST(AddCurve, mergesCurvesOverDifferentPlaces) {
  Plot plot;
  addCurve(plot, "a", {0, 2}, {1, 2});
  addCurve(plot, "b", {2, 3}, {5, 6});
  EXPECT_THAT(plot.x, ElementsAre(0, 2, 3));
  EXPECT_THAT(plot.series[0].y, ElementsAre(1, 2, testing::IsNan()));
  EXPECT_THAT(plot.series[1].y, ElementsAre(testing::IsNan(), 5, 6));
}

TEST(Histogram, countsTheEndsAndLeavesOutTheRest) {
  const Plot plot = histogram({0.0, 0.1, 0.9, 1.0, 1.1, -0.1}, 0.0, 1.0, 2);
  EXPECT_THAT(plot.x, ElementsAre(0.25, 0.75));
  EXPECT_THAT(plot.series[0].y, ElementsAre(2, 2));
}

}  // namespace
}  // namespace leap_object_tracker
