#include "review_panel.h"

#include <algorithm>

#include <OgreAxisAlignedBox.h>
#include <meshless_surgery/Play.h>
#include <meshless_surgery/Seek.h>
#include <rviz/properties/property.h>
#include <rviz/view_controller.h>
#include <rviz/view_manager.h>
#include <rviz/visualization_manager.h>
#include <QComboBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QLineEdit>
#include <QListWidget>
#include <QPushButton>
#include <QSlider>
#include <QVBoxLayout>
#include <pluginlib/class_list_macros.hpp>

namespace meshless {
namespace {

constexpr int kTicks = 10000;         // of the slider
constexpr float kViewFrom = 1.6f;     // lengths of what is seen
constexpr double kStep = 1.0 / 30.0;  // [s]

QString clockText(double seconds) {
  const int minutes = static_cast<int>(seconds / 60.0);
  return QString("%1:%2").arg(minutes).arg(seconds - 60.0 * minutes, 5, 'f', 2, QChar('0'));
}

}  // namespace

ReviewPanel::ReviewPanel(QWidget* parent) : rviz::Panel(parent) {
  auto* layout = new QVBoxLayout(this);
  auto* top = new QHBoxLayout;
  nodes_ = new QLineEdit("/review", this);
  nodes_->setToolTip("The review nodes, with spaces between them: all show the same moment.");
  connect(nodes_, &QLineEdit::editingFinished, this, &ReviewPanel::changeNodes);
  top->addWidget(nodes_, 1);
  layout->addLayout(top);

  auto* buttons = new QHBoxLayout;
  const auto button = [&](const QString& text, const QString& tip) {
    auto* made = new QPushButton(text, this);
    made->setToolTip(tip);
    buttons->addWidget(made);
    return made;
  };
  connect(button("<", "A frame back."), &QPushButton::clicked, this, [this] { seek(now_ - kStep); });
  play_ = button("Play", "From here on; or stand still.");
  connect(play_, &QPushButton::clicked, this, [this] { play(plays_ > 0.0 ? 0.0 : speed_->currentData().toDouble()); });
  connect(button(">", "A frame on."), &QPushButton::clicked, this, [this] { seek(now_ + kStep); });
  speed_ = new QComboBox(this);
  for (const double speed : {0.1, 0.25, 0.5, 1.0, 2.0, 4.0}) speed_->addItem(QString("x %1").arg(speed), speed);
  speed_->setCurrentIndex(3);
  connect(speed_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, [this] {
    if (plays_ > 0.0) play(speed_->currentData().toDouble());
  });
  buttons->addWidget(speed_);
  layout->addLayout(buttons);

  slider_ = new QSlider(Qt::Horizontal, this);
  slider_->setRange(0, kTicks);
  connect(slider_, &QSlider::sliderMoved, this, [this](int tick) { seek(length_ * tick / kTicks); });
  // A click beside the handle, and the keys.
  connect(slider_, &QSlider::actionTriggered, this, [this] {
    if (!slider_->isSliderDown()) seek(length_ * slider_->sliderPosition() / kTicks);
  });
  layout->addWidget(slider_);
  time_ = new QLabel("no word from the node yet", this);
  time_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
  layout->addWidget(time_);

  bookmarks_ = new QListWidget(this);
  connect(bookmarks_, &QListWidget::itemActivated, this,
          [this](QListWidgetItem* item) { seek(item->data(Qt::UserRole).toDouble()); });
  connect(bookmarks_, &QListWidget::itemClicked, this,
          [this](QListWidgetItem* item) { seek(item->data(Qt::UserRole).toDouble()); });
  layout->addWidget(bookmarks_, 1);

  message_ = new QLabel(this);
  message_->setWordWrap(true);
  message_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
  layout->addWidget(message_);
  changeNodes();
}

void ReviewPanel::load(const rviz::Config& config) {
  rviz::Panel::load(config);
  QString nodes;
  if (config.mapGetString("Nodes", &nodes)) {
    nodes_->setText(nodes);
    changeNodes();
  }
}

void ReviewPanel::save(rviz::Config config) const {
  rviz::Panel::save(config);
  config.mapSetValue("Nodes", nodes_->text());
}

void ReviewPanel::changeNodes() {
  review_.shutdown();
  events_.shutdown();
  surfaces_.shutdown();
  for (NodeLink* link : links_) delete link;
  links_.clear();
  asked_ = 0;
  for (const QString& name : nodes_->text().split(' ', QString::SkipEmptyParts)) {
    auto* link = new NodeLink(this);
    link->setNode(name.toStdString());
    links_.push_back(link);
  }
  Q_EMIT configChanged();
  if (links_.empty()) return;
  NodeLink& first = *links_.front();
  review_ = first.handle().subscribe<meshless_surgery::Review>(
      first.nameOf("review"), 5, [this](const meshless_surgery::Review::ConstPtr& review) { show(*review); });
  events_ = first.handle().subscribe<meshless_surgery::Bookmarks>(
      first.nameOf("bookmarks"), 1, [this](const meshless_surgery::Bookmarks::ConstPtr& marks) { list(*marks); });
  surfaces_ = first.handle().subscribe<meshless_surgery::Surfaces>(
      first.nameOf("surfaces"), 1, [this](const meshless_surgery::Surfaces::ConstPtr& surfaces) { face(*surfaces); });
}

void ReviewPanel::show(const meshless_surgery::Review& review) {
  now_ = review.time;
  length_ = review.length;
  plays_ = review.speed;
  play_->setText(plays_ > 0.0 ? "Pause" : "Play");
  time_->setText(QString("%1 of %2   %3").arg(clockText(now_), clockText(length_), QString::fromStdString(review.log)));
  if (!slider_->isSliderDown() && asked_ == 0 && length_ > 0.0)
    slider_->setValue(static_cast<int>(kTicks * now_ / length_ + 0.5));
}

void ReviewPanel::list(const meshless_surgery::Bookmarks& bookmarks) {
  bookmarks_->clear();
  for (std::size_t k = 0; k < bookmarks.times.size(); ++k) {
    auto* item = new QListWidgetItem(
        QString("%1  %2").arg(clockText(bookmarks.times[k]), QString::fromStdString(bookmarks.texts[k])), bookmarks_);
    item->setData(Qt::UserRole, bookmarks.times[k]);
    if (bookmarks.errors[k]) item->setForeground(QColor(190, 40, 30));
  }
}

void ReviewPanel::face(const meshless_surgery::Surfaces& surfaces) {
  rviz::ViewController* view = vis_manager_ ? vis_manager_->getViewManager()->getCurrent() : nullptr;
  Ogre::AxisAlignedBox box;
  for (const auto& body : surfaces.bodies)
    for (std::size_t i = 0; i + 2 < body.vertices.size(); i += 3)
      box.merge(Ogre::Vector3(body.vertices[i], body.vertices[i + 1], body.vertices[i + 2]));
  if (!view || !box.isFinite()) return;
  view->subProp("Distance")->setValue(kViewFrom * box.getSize().length());
  view->lookAt(box.getCenter());
  surfaces_.shutdown();
}

// Of the moments that a slider passes while a node is at work the last one is asked for.
void ReviewPanel::seek(double time) {
  wanted_ = std::clamp(time, 0.0, length_);
  if (asked_ == 0) seekNext();
}

void ReviewPanel::seekNext() {
  if (!wanted_) return;
  meshless_surgery::Seek wish;
  wish.request.time = *wanted_;
  wanted_.reset();
  asked_ = static_cast<int>(links_.size());
  for (std::size_t k = 0; k < links_.size(); ++k) {
    links_[k]->call("seek", wish, [this, k](const meshless_surgery::Seek::Response& answer) {
      // The shorter of two logs has ended.
      if (!answer.success && k == 0) say(QString::fromStdString(answer.message));
      if (answer.success && k == 0) say("");
      if (--asked_ == 0) seekNext();
    });
  }
}

void ReviewPanel::play(double speed) {
  meshless_surgery::Play wish;
  wish.request.speed = speed;
  for (NodeLink* link : links_)
    link->call("play", wish, [this](const meshless_surgery::Play::Response& answer) {
      if (!answer.success) say(QString::fromStdString(answer.message));
    });
}

void ReviewPanel::say(const QString& text) { message_->setText(text); }

}  // namespace meshless

PLUGINLIB_EXPORT_CLASS(meshless::ReviewPanel, rviz::Panel)
