#include "robot_model/urdf_document.hpp"

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <map>
#include <set>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

// urdfdom reports why it failed only through its log: collect it for our own message.
class LogCollector : public console_bridge::OutputHandler {
 public:
  LogCollector() { console_bridge::useOutputHandler(this); }
  ~LogCollector() override { console_bridge::restorePreviousOutputHandler(); }
  LogCollector(const LogCollector&) = delete;
  LogCollector& operator=(const LogCollector&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char* /*filename*/,
           int /*line*/) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR) {
      errors_ += (errors_.empty() ? "" : "; ") + text;
    }
  }

  [[nodiscard]] const std::string& errors() const { return errors_; }

 private:
  std::string errors_;
};

void check_single_parents(const urdf::ModelInterface& document, const std::string& file) {
  std::map<std::string, std::string> joint_above;
  for (const auto& [name, joint] : document.joints_) {
    const auto [entry, is_new] = joint_above.emplace(joint->child_link_name, name);
    if (!is_new) {
      throw InputError(file + ": link '" + joint->child_link_name + "' is the child of joints '" +
                       entry->second + "' and '" + name + "': expected a tree");
    }
  }
}

void collect_reachable(const urdf::LinkConstSharedPtr& link, std::set<std::string>& reached) {
  reached.insert(link->name);
  for (const auto& child : link->child_links) {
    if (!reached.contains(child->name)) {
      collect_reachable(child, reached);
    }
  }
}

void check_connected(const urdf::ModelInterface& document, const std::string& file) {
  std::set<std::string> reached;
  collect_reachable(document.getRoot(), reached);
  for (const auto& [name, link] : document.links_) {
    if (!reached.contains(name)) {
      throw InputError(file + ": link '" + name + "' is not reached from the root '" +
                       document.getRoot()->name + "' (a cycle?): expected a tree");
    }
  }
}

}  // namespace

urdf::ModelInterfaceSharedPtr parse_urdf_document(const std::string& text,
                                                  const std::string& file) {
  urdf::ModelInterfaceSharedPtr document;
  std::string errors;
  {
    const LogCollector log;
    try {
      document = urdf::parseURDF(text);
    } catch (const std::exception& error) {
      throw InputError(file + ": not a usable URDF: " + error.what());
    }
    errors = log.errors();
  }
  // The parser also logs errors it recovers from by dropping elements; a robot with dropped
  // elements is not the robot that was described.
  if (!document || !errors.empty() || !document->getRoot()) {
    throw InputError(file + ": not a usable URDF: " +
                     (errors.empty() ? "bad XML or no <robot> element" : errors));
  }
  check_single_parents(*document, file);
  check_connected(*document, file);
  return document;
}

}  // namespace clamber
