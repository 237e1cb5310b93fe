#include "planner_offline/retarget/retarget_config.hpp"

#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

RetargetChain read_chain(const std::string& name, const YamlNode& node) {
  node.allow_only({"from", "to", "joints", "match"});
  RetargetChain chain{name, node.at("from").text(), node.at("to").text(),
                      node.at("joints").texts()};
  if (const auto match = node.find("match")) {
    if (match->text() == "long_axis") {
      chain.match = ChainMatch::kLongAxis;
    } else if (match->text() != "rotation") {
      match->fail("expected rotation or long_axis");
    }
  }
  if (chain.joints.empty() || chain.joints.size() > 3) {
    node.at("joints").fail("expected 1 to 3 joint names");
  }
  return chain;
}

}  // namespace

RetargetConfig load_retarget_config(const std::filesystem::path& file) {
  const YamlNode root = YamlNode::load(file);
  root.allow_only({"rate", "base_segment", "neutral", "chains", "legs"});
  RetargetConfig config;
  config.source = file.filename().string();
  if (const auto rate = root.find("rate")) config.rate = rate->positive();
  if (const auto base = root.find("base_segment")) config.base_segment = base->text();
  if (const auto neutral = root.find("neutral")) {
    for (const auto& [joint, angle] : neutral->entries()) config.neutral[joint] = angle.number();
  }
  for (const auto& [name, chain] : root.at("chains").entries()) {
    config.chains.push_back(read_chain(name, chain));
  }
  if (config.chains.empty()) root.at("chains").fail("expected at least one chain");
  for (const auto& leg : root.at("legs").items()) {
    leg.allow_only({"hip", "sole"});
    config.legs.push_back({leg.at("hip").text(), leg.at("sole").text()});
  }
  if (config.legs.empty()) root.at("legs").fail("expected at least one leg");
  return config;
}

}  // namespace clamber
