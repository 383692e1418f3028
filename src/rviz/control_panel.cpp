#include "control_panel.h"

#include <cmath>

#include <meshless_surgery/Metrics.h>
#include <meshless_surgery/SetMaterial.h>
#include <meshless_surgery/Step.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <QFormLayout>
#include <QGroupBox>
#include <QHBoxLayout>
#include <QHeaderView>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QSlider>
#include <QTableWidget>
#include <QTimer>
#include <QVBoxLayout>
#include <pluginlib/class_list_macros.hpp>

#include "hand_bars.h"
#include "step_plot.h"
#include "task_text.h"

namespace meshless {
namespace {

constexpr int kRefresh = 200;                         // [ms]
constexpr int kTicks = 1000;                          // of a slider
constexpr double kMostDamping = 100.0;                // [1/s] of the slider
constexpr double kSoftest = 100.0, kHardest = 1.0e6;  // [Pa] of the slider
constexpr double kMostPoisson = 0.49;
constexpr double kFullForce = 5.0;  // [N] that fills a bar where no task says what is too much
constexpr double kUserHolds = 1.0;  // [s] that a slider stays where the user put it, before the node's value is shown

enum Column { kName, kVolume, kParticles, kAsleep, kColumns };

}  // namespace

double ControlPanel::Knob::number() const {
  const double share = static_cast<double>(slider->value()) / kTicks;
  if (scale == Scale::kDecades) return least * std::pow(most / least, share);
  return least + (most - least) * (scale == Scale::kSquared ? share * share : share);
}

void ControlPanel::Knob::set(double number) {
  const double within = std::clamp(number, least, most);
  const double share =
      scale == Scale::kDecades ? std::log(within / least) / std::log(most / least) : (within - least) / (most - least);
  slider->blockSignals(true);
  slider->setValue(static_cast<int>(std::lround(kTicks * (scale == Scale::kSquared ? std::sqrt(share) : share))));
  slider->blockSignals(false);
  label(number);
}

void ControlPanel::Knob::label(double number) {
  value->setText(unit == "Pa" ? QString::number(1e-3 * number, 'g', 3) + " kPa"
                              : QString::number(number, 'g', 3) + (unit.isEmpty() ? unit : " " + unit));
}

ControlPanel::ControlPanel(QWidget* parent) : rviz::Panel(parent), link_(new NodeLink(this)) {
  auto* layout = new QVBoxLayout(this);
  node_ = new QLineEdit("/deformer", this);
  node_->setToolTip("The deformer node that this panel acts on.");
  auto* node_row = new QHBoxLayout;
  node_row->addWidget(new QLabel("Node", this));
  node_row->addWidget(node_);
  layout->addLayout(node_row);
  link_->setNode("/deformer");
  connect(node_, &QLineEdit::editingFinished, this, &ControlPanel::changeNode);

  auto* buttons = new QHBoxLayout;
  const auto button = [&](const QString& text, const QString& tip) {
    auto* made = new QPushButton(text, this);
    made->setToolTip(tip);
    made->setMinimumWidth(10);
    buttons->addWidget(made);
    return made;
  };
  pause_ = button("Pause", "Time stands still, or runs again.");
  connect(pause_, &QPushButton::clicked, this, [this] {
    std_srvs::SetBool wish;
    wish.request.data = !(state_ && state_->paused);
    link_->call("pause", wish, [this](const auto& answer) { say(QString::fromStdString(answer.message)); });
  });
  connect(button("Step", "One step, as long as time stands still."), &QPushButton::clicked, this, [this] {
    meshless_surgery::Step wish;
    wish.request.steps = 1;
    link_->call("step", wish, [this](const auto& answer) { say(QString::fromStdString(answer.message)); });
  });
  connect(button("Reset", "Back to the scene's start."), &QPushButton::clicked, this, [this] { call("reset"); });
  connect(button("Undo cut", "The state before the last cut or incision."), &QPushButton::clicked, this,
          [this] { call("undo_cut"); });
  layout->addLayout(buttons);

  const auto paragraph = [this] {
    auto* made = new QLabel(this);
    made->setWordWrap(true);
    made->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
    return made;
  };
  task_ = paragraph();
  QSizePolicy whole(QSizePolicy::Ignored, QSizePolicy::Minimum);  // as high as its text is, however narrow
  whole.setHeightForWidth(true);
  task_->setSizePolicy(whole);
  task_->hide();
  layout->addWidget(task_);

  time_ = new QLabel("no state from the node yet", this);
  // A longer number must not widen the panel, which would move the view.
  time_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
  layout->addWidget(time_);
  plot_ = new StepPlot(this);
  layout->addWidget(plot_);
  hands_ = new HandBars(this);
  layout->addWidget(hands_);

  bodies_ = new QTableWidget(0, kColumns, this);
  bodies_->setHorizontalHeaderLabels({"Body", "Volume [ml]", "Particles", "Asleep"});
  bodies_->horizontalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);
  bodies_->horizontalHeader()->setSectionResizeMode(kName, QHeaderView::Stretch);
  bodies_->verticalHeader()->hide();
  bodies_->setEditTriggers(QAbstractItemView::NoEditTriggers);
  bodies_->setSelectionBehavior(QAbstractItemView::SelectRows);
  bodies_->setSelectionMode(QAbstractItemView::SingleSelection);
  layout->addWidget(bodies_, 1);
  connect(bodies_, &QTableWidget::itemSelectionChanged, this, [this] {
    for (Knob& knob : knobs_) knob.since_user = 1e9;
    fillMaterial();
  });

  material_ = new QGroupBox("Material", this);
  form_ = new QFormLayout(material_);
  using Body = meshless_surgery::BodyState;
  const auto knob = [](const char* key, const char* unit, double (*of)(const Body&), double least, double most,
                       Scale scale, Family family) {
    Knob made;
    made.key = key;
    made.unit = unit;
    made.of = of;
    made.least = least;
    made.most = most;
    made.scale = scale;
    made.family = family;
    return made;
  };
  addKnob(knob(
              "alpha", "", [](const Body& body) { return body.alpha; }, 0.0, 1.0, Scale::kLinear, Family::kAppearance),
          "How far tissue goes towards its goal in 1/60 s: 1 is stiff.");
  addKnob(knob(
              "beta", "", [](const Body& body) { return body.beta; }, 0.0, 1.0, Scale::kLinear, Family::kAppearance),
          "How much of a linear or quadratic deformation the goal may have.");
  addKnob(knob(
              "youngs_modulus", "Pa", [](const Body& body) { return body.youngs_modulus; }, kSoftest, kHardest,
              Scale::kDecades, Family::kElastic),
          "How stiff tissue is.");
  addKnob(knob(
              "poissons_ratio", "", [](const Body& body) { return body.poissons_ratio; }, 0.0, kMostPoisson,
              Scale::kLinear, Family::kElastic),
          "How well tissue keeps its volume: near 0.5 it does.");
  addKnob(knob(
              "damping", "1/s", [](const Body& body) { return body.damping; }, 0.0, kMostDamping, Scale::kSquared,
              Family::kAny),
          "Of the motion that deforms.");
  layout->addWidget(material_);

  message_ = paragraph();
  layout->addWidget(message_);

  timer_ = new QTimer(this);
  connect(timer_, &QTimer::timeout, this, &ControlPanel::refresh);
}

void ControlPanel::addKnob(Knob knob, const QString& tip) {
  knob.row = new QWidget(material_);
  knob.slider = new QSlider(Qt::Horizontal, knob.row);
  knob.slider->setRange(0, kTicks);
  knob.slider->setToolTip(tip);
  knob.value = new QLabel("-", knob.row);
  knob.value->setMinimumWidth(60);
  auto* row = new QHBoxLayout(knob.row);
  row->setContentsMargins(0, 0, 0, 0);
  row->addWidget(knob.slider, 1);
  row->addWidget(knob.value);
  form_->addRow(knob.key, knob.row);
  const std::size_t index = knobs_.size();
  connect(knob.slider, &QSlider::valueChanged, this, [this, index] {
    knobs_[index].changed = true;
    knobs_[index].since_user = 0.0;
    knobs_[index].label(knobs_[index].number());
  });
  knobs_.push_back(knob);
}

void ControlPanel::load(const rviz::Config& config) {
  rviz::Panel::load(config);
  QString node;
  if (config.mapGetString("Node", &node)) {
    node_->setText(node);
    changeNode();
  }
}

void ControlPanel::save(rviz::Config config) const {
  rviz::Panel::save(config);
  config.mapSetValue("Node", node_->text());
}

void ControlPanel::showEvent(QShowEvent* event) {
  rviz::Panel::showEvent(event);
  listen();
  timer_->start(kRefresh);
}

void ControlPanel::hideEvent(QHideEvent* event) {
  rviz::Panel::hideEvent(event);
  timer_->stop();
  state_subscriber_.shutdown();
  task_subscriber_.shutdown();
  metrics_subscriber_.shutdown();
}

void ControlPanel::listen() {
  state_subscriber_ = link_->handle().subscribe<meshless_surgery::State>(
      link_->nameOf("state"), 5, [this](const meshless_surgery::State::ConstPtr& state) {
        state_ = state;
        fresh_ = true;
        if (!state->paused) plot_->add({state->mean_step, state->worst_step, state->real_time_factor});
      });
  task_subscriber_ = link_->handle().subscribe<meshless_surgery::TaskState>(
      link_->nameOf("task"), 5, [this](const meshless_surgery::TaskState::ConstPtr& task) {
        task_now_ = task;
        task_time_ = -1.0;
        task_->setText(taskText(*task));
        task_->setVisible(!task->task.empty());
        material_->setVisible(!task->running);  // a trainee has other work
      });
  metrics_subscriber_ = link_->handle().subscribe<meshless_surgery::Metrics>(
      link_->nameOf("metrics"), 5, [this](const meshless_surgery::Metrics::ConstPtr& metrics) {
        if (!task_now_ || std::floor(metrics->time) == task_time_) return;
        task_time_ = std::floor(metrics->time);
        task_->setText(taskText(*task_now_, task_time_));
      });
}

void ControlPanel::changeNode() {
  const std::string before = link_->node();
  link_->setNode(node_->text().toStdString());
  if (link_->node() == before) return;
  state_.reset();
  plot_->clear();
  task_->hide();
  task_now_.reset();
  bodies_->setRowCount(0);
  hands_->show({}, kFullForce);
  time_->setText("no state from the node yet");
  if (isVisible()) listen();
  Q_EMIT configChanged();
}

void ControlPanel::call(const char* name) {
  link_->call(name, std_srvs::Trigger(),
              [this](const std_srvs::Trigger::Response& answer) { say(QString::fromStdString(answer.message)); });
}

void ControlPanel::say(const QString& text) { message_->setText(text); }

void ControlPanel::refresh() {
  for (Knob& knob : knobs_) knob.since_user += 1e-3 * kRefresh;
  sendMaterial();
  if (!fresh_ || !state_) return;
  fresh_ = false;
  pause_->setText(state_->paused ? "Run" : "Pause");
  time_->setText(
      QString("%1 s   %2   step %3 ms, worst %4")
          .arg(state_->sim_time, 0, 'f', 2)
          .arg(state_->paused ? QString("paused") : QString("speed %1").arg(state_->real_time_factor, 0, 'f', 2))
          .arg(1e3 * state_->mean_step, 0, 'f', 2)
          .arg(1e3 * state_->worst_step, 0, 'f', 1));
  const bool limited = task_now_ && task_now_->running && task_now_->force_limit > 0.0;
  hands_->show(handForces(*state_), limited ? task_now_->force_limit : kFullForce);
  fillBodies();
  fillMaterial();
}

void ControlPanel::fillBodies() {
  const int rows = static_cast<int>(state_->bodies.size());
  const QString name = selected();
  bodies_->blockSignals(true);
  bodies_->setRowCount(rows);
  int row_of_name = rows > 0 ? 0 : -1;
  for (int row = 0; row < rows; ++row) {
    const auto& body = state_->bodies[static_cast<std::size_t>(row)];
    const QString texts[kColumns] = {QString::fromStdString(body.name),
                                     body.volume > 0.0 ? QString::number(1e6 * body.volume, 'f', 1) : QString("open"),
                                     QString::number(body.particles), body.asleep ? QString("yes") : QString("no")};
    for (int column = 0; column < kColumns; ++column) {
      QTableWidgetItem* item = bodies_->item(row, column);
      if (!item) bodies_->setItem(row, column, item = new QTableWidgetItem);
      if (item->text() != texts[column]) item->setText(texts[column]);
    }
    if (texts[kName] == name) row_of_name = row;
  }
  if (row_of_name >= 0) bodies_->selectRow(row_of_name);
  bodies_->blockSignals(false);
}

QString ControlPanel::selected() const {
  const QTableWidgetItem* item = bodies_->item(bodies_->currentRow(), kName);
  return item ? item->text() : QString();
}

void ControlPanel::fillMaterial() {
  if (!state_) return;
  const std::string name = selected().toStdString();
  const meshless_surgery::BodyState* found = nullptr;
  for (const auto& body : state_->bodies)
    if (body.name == name) found = &body;
  material_->setEnabled(found != nullptr);
  if (!found) return;
  const Family family = found->youngs_modulus > 0.0 ? Family::kElastic : Family::kAppearance;
  material_->setTitle("Material of " + selected() + (family == Family::kElastic ? ", elastic" : ""));
  for (Knob& knob : knobs_) {
    const bool used = knob.family == Family::kAny || knob.family == family;
    knob.row->setVisible(used);
    form_->labelForField(knob.row)->setVisible(used);
    if (used && !knob.slider->isSliderDown() && knob.since_user > kUserHolds) knob.set(knob.of(*found));
  }
}

void ControlPanel::sendMaterial() {
  QStringList keys;
  for (Knob& knob : knobs_) {
    if (knob.changed) keys << knob.key + ": " + QString::number(knob.number(), 'g', 6);
    knob.changed = false;
  }
  if (keys.isEmpty() || selected().isEmpty()) return;
  meshless_surgery::SetMaterial wish;
  wish.request.body = selected().toStdString();
  wish.request.yaml = ("{" + keys.join(", ") + "}").toStdString();
  link_->call("set_material", wish, [this](const meshless_surgery::SetMaterial::Response& answer) {
    say(QString::fromStdString(answer.message));
  });
}

}  // namespace meshless

PLUGINLIB_EXPORT_CLASS(meshless::ControlPanel, rviz::Panel)
