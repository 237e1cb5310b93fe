#include "robot_model/urdf_document.hpp"

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <map>
#include <pugixml.hpp>

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

// urdfdom's XML reader calls itself for every element inside an element: beyond some ten thousand
// of them the stack overflows. A URDF needs six.
constexpr int kMaxDepth = 64;

class DepthCheck : public pugi::xml_tree_walker {
 public:
  bool for_each(pugi::xml_node& /*node*/) override { return depth() < kMaxDepth; }
};

struct Edge {
  std::string joint;
  std::string parent;
};

std::map<std::string, Edge> read_edges(const pugi::xml_node& robot, const std::string& file) {
  std::map<std::string, Edge> edge_above;
  for (const pugi::xml_node joint : robot.children("joint")) {
    const std::string name = joint.attribute("name").value();
    const std::string child = joint.child("child").attribute("link").value();
    const auto [entry, is_new] =
        edge_above.emplace(child, Edge{name, joint.child("parent").attribute("link").value()});
    if (!is_new) {
      throw InputError(file + ": link '" + child + "' is the child of joints '" +
                       entry->second.joint + "' and '" + name + "': expected a tree");
    }
  }
  return edge_above;
}

// Links point at each other with shared ownership in urdfdom, so a cycle would never be freed:
// refuse it before the text gets there.
void check_tree(const std::string& text, const std::string& file) {
  pugi::xml_document document;
  const pugi::xml_parse_result result = document.load_buffer(text.data(), text.size());
  if (!result) {
    const auto end = text.begin() + std::clamp<std::ptrdiff_t>(
                                        result.offset, 0, static_cast<std::ptrdiff_t>(text.size()));
    throw InputError(file + ":" + std::to_string(1 + std::count(text.begin(), end, '\n')) +
                     ": not a usable URDF: bad XML: " + result.description());
  }
  DepthCheck depth;
  if (!document.traverse(depth)) {
    throw InputError(file + ": not a usable URDF: XML elements nested deeper than " +
                     std::to_string(kMaxDepth));
  }
  const std::map<std::string, Edge> edge_above = read_edges(document.child("robot"), file);
  for (const auto& [link, edge] : edge_above) {
    std::size_t steps = 0;
    for (auto above = edge_above.find(link); above != edge_above.end();
         above = edge_above.find(above->second.parent)) {
      if (++steps > edge_above.size()) {
        throw InputError(file + ": link '" + link + "' hangs on a cycle of joints (through '" +
                         edge.joint + "'): expected a tree");
      }
    }
  }
}

}  // namespace

urdf::ModelInterfaceSharedPtr parse_urdf_document(const std::string& text,
                                                  const std::string& file) {
  check_tree(text, file);
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
  return document;
}

}  // namespace clamber
