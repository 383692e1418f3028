// The panel: what the task asks for, bodies, time, materials, and undo of the last cut.
#pragma once

#include <rviz/panel.h>

#ifndef Q_MOC_RUN
#include <meshless_surgery/State.h>
#include <meshless_surgery/TaskState.h>

#include "node_link.h"
#endif

class QFormLayout;
class QGroupBox;
class QLabel;
class QLineEdit;
class QPushButton;
class QSlider;
class QTableWidget;
class QTimer;

namespace meshless {

class HandBars;
class StepPlot;

class ControlPanel : public rviz::Panel {
  Q_OBJECT

 public:
  explicit ControlPanel(QWidget* parent = nullptr);

  void load(const rviz::Config& config) override;
  void save(rviz::Config config) const override;

 protected:
  // The node's state is listened to only while the panel is seen.
  void showEvent(QShowEvent* event) override;
  void hideEvent(QHideEvent* event) override;

 private Q_SLOTS:
  void changeNode();
  void refresh();
  void sendMaterial();

 private:
  enum class Scale { kLinear, kSquared, kDecades };   // squared: finer near zero
  enum class Family { kAny, kAppearance, kElastic };  // of materials
  /// A material's number and its slider.
  struct Knob {
    QString key, unit;
    double (*of)(const meshless_surgery::BodyState& body) = nullptr;
    double least = 0.0, most = 1.0;
    Scale scale = Scale::kLinear;
    Family family = Family::kAny;  // that uses it
    QWidget* row = nullptr;
    QSlider* slider = nullptr;
    QLabel* value = nullptr;
    bool changed = false;     // by the user, and not sent yet
    double since_user = 1e9;  // [s]

    double number() const;
    void set(double number);
    void label(double number);
  };

  void listen();
  void call(const char* name);
  void fillBodies();
  void addKnob(Knob knob, const QString& tip);
  void fillMaterial();
  void say(const QString& text);
  QString selected() const;

  NodeLink* link_;
  ros::Subscriber state_subscriber_, task_subscriber_, metrics_subscriber_;
  meshless_surgery::TaskState::ConstPtr task_now_;
  double task_time_ = -1.0;  // [s]
  meshless_surgery::State::ConstPtr state_;
  bool fresh_ = false;
  QLineEdit* node_;
  QPushButton* pause_;
  QLabel* time_;
  QLabel* task_;
  StepPlot* plot_;
  HandBars* hands_;
  QTableWidget* bodies_;
  QGroupBox* material_;
  QFormLayout* form_;
  std::vector<Knob> knobs_;
  QLabel* message_;
  QTimer* timer_;
};

}  // namespace meshless
