#include "leap_object_tracker/evaluation/html_page.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <sstream>
#include <stdexcept>

#include "report_assets.hpp"

namespace leap_object_tracker {
namespace {

constexpr const char* kStyle = R"(
body{font:15px/1.5 system-ui,sans-serif;color:#222;max-width:1000px;margin:2em auto;padding:0 1em}
h1{font-size:1.6em}h2{font-size:1.25em;margin-top:2em;border-bottom:1px solid #ccc}
table{border-collapse:collapse;margin:1em 0;font-variant-numeric:tabular-nums}
th,td{border:1px solid #ccc;padding:.2em .7em;text-align:right}
th{background:#f0f2f5}td:first-child,th:first-child{text-align:left}
figure{margin:1em 0;display:inline-block}img{max-width:100%;display:block}
figcaption{color:#555;font-size:.9em}.plot{margin:1.2em 0}.scroll{overflow-x:auto}
)";

/// Turns the description of a plot into a uPlot chart.
constexpr const char* kScript = R"(
const colours=['#1f77b4','#d62728','#2ca02c','#ff7f0e','#9467bd','#17becf','#8c564b','#7f7f7f'];
function draw(id,p){
  const series=[{label:p.x_label}].concat(p.series.map((label,i)=>{
    const colour=colours[i%colours.length],s={label:label,stroke:colour,width:1.5,spanGaps:false};
    if(p.kind==='bars'){s.fill=colour+'60';s.paths=uPlot.paths.bars({size:[0.9,100]});s.points={show:false};}
    else if(p.kind==='points'){s.paths=()=>null;s.points={show:true,size:4,fill:colour};}
    else s.points={show:false};
    return s;}));
  const axis=label=>({label:label,size:60,labelSize:24});
  const y=p.log_y?{distr:3}:{};
  if(p.kind==='bars')y.range=(u,low,high)=>[0,high>0?high*1.05:1];
  new uPlot({title:p.title,width:Math.min(960,document.body.clientWidth-20),height:320,
    scales:{x:{time:false},y:y},series:series,axes:[axis(p.x_label),axis(p.y_label)]},
    p.data,document.getElementById(id));
}
)";

std::string escaped(const std::string& text) {
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
      default:
        result += c;
    }
  }
  return result;
}

/// A JavaScript string; `<` is written so that no text can end the script.
std::string quoted(const std::string& text) {
  std::ostringstream out;
  out << '"';
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out << '\\' << c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == '<') {
      out << "\\u00"
          << "0123456789abcdef"[c >> 4] << "0123456789abcdef"[c & 15];
    } else {
      out << c;
    }
  }
  out << '"';
  return out.str();
}

std::string numbers(const std::vector<double>& values) {
  std::ostringstream out;
  out.precision(7);
  out << '[';
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0) out << ',';
    if (std::isfinite(values[i]))
      out << values[i];
    else
      out << "null";
  }
  out << ']';
  return out.str();
}

/// RFC 4648, section 4.
std::string base64(const std::string& bytes) {
  constexpr const char* kAlphabet =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string result;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    unsigned group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8 | (k < count ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      result += k <= count ? kAlphabet[group >> (18 - 6 * k) & 63] : '=';
  }
  return result;
}

const char* kindName(Plot::Kind kind) {
  switch (kind) {
    case Plot::Kind::kBars:
      return "bars";
    case Plot::Kind::kPoints:
      return "points";
    case Plot::Kind::kLines:
      break;
  }
  return "lines";
}

std::string row(const std::vector<std::string>& cells, const char* tag) {
  std::string result = "<tr>";
  for (const auto& cell : cells)
    result += std::string("<") + tag + ">" + escaped(cell) + "</" + tag + ">";
  return result + "</tr>\n";
}

std::string pictureType(const std::string& bytes) {
  if (bytes.compare(0, 4, "\x89PNG") == 0) return "png";
  if (bytes.compare(0, 2, "\xff\xd8") == 0) return "jpeg";
  return "";
}

}  // namespace

void addCurve(Plot& plot, const std::string& label, const std::vector<double>& x,
              const std::vector<double>& y) {
  if (x.size() != y.size())
    throw std::invalid_argument("plot '" + plot.title + "': curve '" + label + "' has " +
                                std::to_string(x.size()) + " x and " + std::to_string(y.size()) +
                                " y");
  constexpr double kHole = std::numeric_limits<double>::quiet_NaN();
  std::map<double, std::vector<double>> rows;
  const std::size_t known = plot.series.size();
  for (std::size_t i = 0; i < plot.x.size(); ++i) {
    auto& row = rows[plot.x[i]];
    for (const auto& series : plot.series) row.push_back(series.y[i]);
    row.push_back(kHole);
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    auto& row = rows[x[i]];
    row.resize(known + 1, kHole);
    row[known] = y[i];
  }
  plot.series.push_back({label, {}});
  plot.x.clear();
  for (auto& series : plot.series) series.y.clear();
  for (const auto& [position, row] : rows) {
    plot.x.push_back(position);
    for (std::size_t s = 0; s < row.size(); ++s) plot.series[s].y.push_back(row[s]);
  }
}

Plot histogram(const std::vector<double>& values, double low, double high, int bins) {
  Plot plot;
  plot.kind = Plot::Kind::kBars;
  const double width = (high - low) / bins;
  PlotSeries counts{"count", std::vector<double>(static_cast<std::size_t>(bins), 0.0)};
  for (int i = 0; i < bins; ++i) plot.x.push_back(low + (i + 0.5) * width);
  for (const double value : values) {
    if (!(value >= low && value <= high)) continue;
    const int bin = std::min(bins - 1, static_cast<int>((value - low) / width));
    counts.y[static_cast<std::size_t>(bin)] += 1;
  }
  plot.series.push_back(counts);
  return plot;
}

HtmlPage::HtmlPage(const std::string& title) : title_(title) {}

void HtmlPage::addHeading(const std::string& text) { body_ += "<h2>" + escaped(text) + "</h2>\n"; }

void HtmlPage::addText(const std::string& text) { body_ += "<p>" + escaped(text) + "</p>\n"; }

void HtmlPage::addTable(const std::vector<std::string>& headings,
                        const std::vector<std::vector<std::string>>& rows) {
  body_ += "<div class=\"scroll\"><table>\n" + row(headings, "th");
  for (const auto& cells : rows) {
    if (cells.size() != headings.size())
      throw std::invalid_argument("table: a row has " + std::to_string(cells.size()) +
                                  " cells under " + std::to_string(headings.size()) + " headings");
    body_ += row(cells, "td");
  }
  body_ += "</table></div>\n";
}

void HtmlPage::addPlot(const Plot& plot) {
  std::string labels, data = numbers(plot.x);
  for (const auto& series : plot.series) {
    if (series.y.size() != plot.x.size())
      throw std::invalid_argument("plot '" + plot.title + "': '" + series.label + "' has " +
                                  std::to_string(series.y.size()) + " values for " +
                                  std::to_string(plot.x.size()) + " x");
    labels += (labels.empty() ? "" : ",") + quoted(series.label);
    data += "," + numbers(series.y);
  }
  const std::string id = "plot" + std::to_string(plots_++);
  body_ += "<div class=\"plot\" id=\"" + id + "\"></div>\n<script>draw(" + quoted(id) +
           ",{title:" + quoted(plot.title) + ",x_label:" + quoted(plot.x_label) +
           ",y_label:" + quoted(plot.y_label) + ",kind:" + quoted(kindName(plot.kind)) +
           ",log_y:" + (plot.log_y ? "true" : "false") + ",series:[" + labels + "],data:[" + data +
           "]});</script>\n";
}

void HtmlPage::addPicture(const std::string& path, const std::string& caption) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("picture '" + path + "': cannot be opened to read");
  const std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const std::string type = pictureType(bytes);
  if (type.empty()) throw std::runtime_error("picture '" + path + "': neither PNG nor JPEG");
  body_ += "<figure><img alt=\"" + escaped(caption) + "\" src=\"data:image/" + type + ";base64," +
           base64(bytes) + "\"><figcaption>" + escaped(caption) + "</figcaption></figure>\n";
}

void HtmlPage::write(const std::string& path) const {
  std::ofstream file(path);
  if (!file) throw std::runtime_error("report '" + path + "': cannot be opened to write");
  file << "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>"
       << escaped(title_) << "</title>\n<style>" << kStyle << kChartStyle << "</style>\n<script>"
       << kChartScript << kScript << "</script></head>\n<body>\n<h1>" << escaped(title_)
       << "</h1>\n"
       << body_ << "</body></html>\n";
  file.flush();
  if (!file)
    throw std::runtime_error("report '" + path + "': cannot be written, is the disk full?");
}

}  // namespace leap_object_tracker
