// A small plot of the last seconds: how long steps take, and the real-time factor.
#pragma once

#include <deque>

#include <QWidget>

namespace meshless {

class StepPlot : public QWidget {
  Q_OBJECT

 public:
  struct Sample {
    double mean_step = 0.0;   // [s]
    double worst_step = 0.0;  // [s]
    double real_time_factor = 0.0;
  };

  explicit StepPlot(QWidget* parent);
  void add(const Sample& sample);
  void clear();
  QSize sizeHint() const override { return QSize(260, 110); }

 protected:
  void paintEvent(QPaintEvent* event) override;

 private:
  std::deque<Sample> samples_;
};

}  // namespace meshless
