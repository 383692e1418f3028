#include "hand_bars.h"

#include <algorithm>
#include <cmath>

#include <QFormLayout>
#include <QLabel>
#include <QProgressBar>

namespace meshless {
namespace {

constexpr int kBarTicks = 1000;

double lengthOf(const geometry_msgs::Vector3& v) { return std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z); }

/// Green without force, yellow in the middle, red where full.
QString styleOf(double share) {
  const int hue = static_cast<int>(std::lround(120.0 * (1.0 - share)));
  return QString("QProgressBar::chunk { background-color: hsl(%1, 200, 110); }").arg(hue);
}

}  // namespace

std::vector<HandForce> handForces(const meshless_surgery::State& state) {
  std::vector<HandForce> hands;
  for (const auto& instrument : state.instruments)
    hands.push_back({QString::fromStdString(instrument.name), lengthOf(instrument.force),
                     QString::fromStdString(instrument.holds), instrument.grip});
  for (const auto& pick : state.picks)
    if (!pick.locked)
      hands.push_back(
          {QString("pick %1").arg(pick.pick_id), lengthOf(pick.force), QString::fromStdString(pick.body), 0.0});
  return hands;
}

QString forceText(const HandForce& hand) {
  QString text = QString::number(hand.force, 'f', 2) + " N";
  if (hand.holds.isEmpty()) return text;
  if (!(hand.grip > 0.0)) return text + ", holds " + hand.holds;
  return text + ", grips " + hand.holds + " with " + QString::number(hand.grip, 'f', 1) + " N";
}

HandBars::HandBars(QWidget* parent) : QWidget(parent), form_(new QFormLayout(this)) {
  form_->setContentsMargins(0, 0, 0, 0);
  // A longer text must not widen the panel, which would move the view.
  setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Maximum);
  hide();
}

void HandBars::show(const std::vector<HandForce>& hands, double full) {
  while (bars_.size() > hands.size()) {
    form_->removeRow(static_cast<int>(bars_.size()) - 1);
    bars_.pop_back();
  }
  while (bars_.size() < hands.size()) {
    auto* bar = new QProgressBar(this);
    bar->setRange(0, kBarTicks);
    bar->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Fixed);
    bar->setAlignment(Qt::AlignCenter);
    form_->addRow(new QLabel(this), bar);
    bars_.push_back(bar);
  }
  for (std::size_t n = 0; n < hands.size(); ++n) {
    const double share = std::clamp(hands[n].force / full, 0.0, 1.0);
    static_cast<QLabel*>(form_->labelForField(bars_[n]))->setText(hands[n].name);
    const int ticks = static_cast<int>(std::lround(kBarTicks * share));
    if (bars_[n]->value() != ticks) bars_[n]->setStyleSheet(styleOf(share));
    bars_[n]->setValue(ticks);
    bars_[n]->setFormat(forceText(hands[n]));
    bars_[n]->setToolTip(QString("The force that %1 feels; full and red from %2 N on.").arg(hands[n].name).arg(full));
  }
  setVisible(!hands.empty());
}

}  // namespace meshless
