#include "step_plot.h"

#include <algorithm>
#include <cmath>

#include <QPainter>
#include <QPainterPath>

namespace meshless {
namespace {

constexpr std::size_t kSamples = 300;  // 10 s of the node's usual 30 Hz
constexpr double kTopFactor = 1.25;    // real-time factor at the upper edge
constexpr double kLeastTop = 2e-3;     // [s] at the upper edge, at the least
const QColor kMean(60, 110, 200);
const QColor kWorst(170, 195, 235);
const QColor kFactor(40, 150, 70);

}  // namespace

StepPlot::StepPlot(QWidget* parent) : QWidget(parent) {
  setMinimumHeight(80);
  setToolTip("Blue: time that a step takes, mean and worst of a second. Green: real-time factor, dashed at 1.");
}

void StepPlot::add(const Sample& sample) {
  samples_.push_back(sample);
  if (samples_.size() > kSamples) samples_.pop_front();
  update();
}

void StepPlot::clear() {
  samples_.clear();
  update();
}

void StepPlot::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  const QRectF area = QRectF(rect()).adjusted(1, 1, -1, -1);
  painter.fillRect(area, palette().base());
  painter.setPen(palette().mid().color());
  painter.drawRect(area);

  // The upper edge is 1, 2 or 5 times a power of ten, so that it does not jump about.
  double most = kLeastTop;
  for (const Sample& sample : samples_) most = std::max(most, sample.worst_step);
  double top = std::pow(10.0, std::floor(std::log10(most)));
  top *= most <= top ? 1.0 : most <= 2.0 * top ? 2.0 : most <= 5.0 * top ? 5.0 : 10.0;

  const auto draw = [&](const QColor& color, double scale, double Sample::*value) {
    QPainterPath path;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const double x = area.right() - static_cast<double>(samples_.size() - 1 - i) / (kSamples - 1) * area.width();
      const double y = area.bottom() - std::clamp(samples_[i].*value / scale, 0.0, 1.0) * area.height();
      i == 0 ? path.moveTo(x, y) : path.lineTo(x, y);
    }
    painter.setPen(QPen(color, 1.5));
    painter.drawPath(path);
  };
  const double one = area.bottom() - area.height() / kTopFactor;
  painter.setPen(QPen(kFactor, 1.0, Qt::DashLine));
  painter.drawLine(QPointF(area.left(), one), QPointF(area.right(), one));
  draw(kWorst, top, &Sample::worst_step);
  draw(kMean, top, &Sample::mean_step);
  draw(kFactor, kTopFactor, &Sample::real_time_factor);

  painter.setPen(palette().text().color());
  const QRectF text = area.adjusted(4, 2, -4, -2);
  painter.drawText(text, Qt::AlignLeft | Qt::AlignTop, QString::number(1e3 * top) + " ms");
  painter.drawText(text, Qt::AlignRight | Qt::AlignBottom, "10 s");
}

}  // namespace meshless
