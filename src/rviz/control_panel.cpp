#include "control_panel.h"

#include <cmath>

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

#include "step_plot.h"
#include "task_text.h"

namespace meshless {
namespace {

constexpr int kRefresh = 200;           // [ms]
constexpr int kTicks = 1000;            // of a slider
constexpr double kMostDamping = 100.0;  // [1/s] of the slider
constexpr double kUserHolds = 1.0;  // [s] that a slider stays where the user put it, before the node's value is shown

enum Column { kName, kVolume, kParticles, kAsleep, kColumns };

}  // namespace

double ControlPanel::Knob::number() const {
  const double share = static_cast<double>(slider->value()) / kTicks;
  return most * (squared ? share * share : share);
}

void ControlPanel::Knob::set(double number) {
  const double share = std::clamp(number / most, 0.0, 1.0);
  slider->blockSignals(true);
  slider->setValue(static_cast<int>(std::lround(kTicks * (squared ? std::sqrt(share) : share))));
  slider->blockSignals(false);
  value->setText(QString::number(number, 'g', 3));
}

void ControlPanel::Knob::label() { value->setText(QString::number(number(), 'g', 3)); }

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
  auto* form = new QFormLayout(material_);
  const auto knob = [&](const QString& key, double most, bool squared, bool elastic, const QString& tip) {
    Knob made;
    made.key = key;
    made.most = most;
    made.squared = squared;
    made.elastic = elastic;
    made.slider = new QSlider(Qt::Horizontal, material_);
    made.slider->setRange(0, kTicks);
    made.slider->setToolTip(tip);
    made.value = new QLabel("-", material_);
    made.value->setMinimumWidth(48);
    auto* row = new QHBoxLayout;
    row->addWidget(made.slider, 1);
    row->addWidget(made.value);
    form->addRow(key, row);
    const std::size_t index = knobs_.size();
    connect(made.slider, &QSlider::valueChanged, this, [this, index] {
      knobs_[index].changed = true;
      knobs_[index].since_user = 0.0;
      knobs_[index].label();
    });
    knobs_.push_back(made);
  };
  knob("alpha", 1.0, false, false, "How far tissue goes towards its goal in 1/60 s: 1 is stiff. Appearance materials.");
  knob("beta", 1.0, false, false,
       "How much of a linear or quadratic deformation the goal may have. Appearance materials.");
  knob("damping", kMostDamping, true, true, "[1/s] of the motion that deforms.");
  layout->addWidget(material_);

  message_ = paragraph();
  layout->addWidget(message_);

  timer_ = new QTimer(this);
  connect(timer_, &QTimer::timeout, this, &ControlPanel::refresh);
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
        task_->setText(taskText(*task));
        task_->setVisible(!task->task.empty());
        material_->setVisible(!task->running);  // a trainee has other work
      });
}

void ControlPanel::changeNode() {
  const std::string before = link_->node();
  link_->setNode(node_->text().toStdString());
  if (link_->node() == before) return;
  state_.reset();
  plot_->clear();
  task_->hide();
  bodies_->setRowCount(0);
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
  const bool elastic = found->youngs_modulus > 0.0;
  material_->setTitle(
      "Material of " + selected() +
      (elastic ? QString(", elastic, %1 kPa").arg(1e-3 * found->youngs_modulus, 0, 'g', 3) : QString()));
  const double numbers[] = {found->alpha, found->beta, found->damping};
  for (std::size_t i = 0; i < knobs_.size(); ++i) {
    Knob& knob = knobs_[i];
    knob.slider->setEnabled(knob.elastic || !elastic);
    if (!knob.slider->isSliderDown() && knob.since_user > kUserHolds) knob.set(numbers[i]);
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
