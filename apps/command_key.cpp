// clamber key: the keys that sign bundles, and the ones that a robot trusts.
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/options.hpp"
#include "deploy/keys.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

struct Options {
  std::string file;
  std::string name;
  std::string root = "/";
  std::string successor;
  std::string out;
};

void print(const PublicKey& key) { std::cout << key.id() << "  " << key.name << '\n'; }

void make(const Options& options) {
  const std::string name =
      options.name.empty() ? std::filesystem::path(options.file).filename().string() : options.name;
  print(new_key(options.file, name));
  std::cout << "secret:  " << options.file << " (keep it here, mode 0600)\n"
            << "public:  " << options.file << ".pub (for `clamber key pin` on the robot)\n";
}

void show(const Options& options) {
  if (!options.file.empty()) return print(load_public_key(options.file));
  const std::vector<PublicKey> keys = pinned_keys(options.root);
  for (const PublicKey& key : keys) print(key);
  if (keys.empty()) std::cout << "no key is pinned below " << options.root << '\n';
}

bool is_rotation(const std::string& file) { return file.ends_with(".rotation"); }

void pin(const Options& options) {
  if (is_rotation(options.file)) {
    const Rotation rotation = follow_rotation(options.root, options.file);
    std::cout << "pinned:  ";
    print(rotation.successor);
    std::cout << "dropped: ";
    return print(rotation.old);
  }
  const PublicKey key = load_public_key(options.file);
  std::cout << (pin_key(options.root, key) ? "pinned:  " : "already: ");
  print(key);
}

void unpin(const Options& options) {
  if (!unpin_key(options.root, options.file))
    throw InputError("key " + options.file + " is not pinned: `clamber key show` lists them");
  std::cout << "dropped: " << options.file << '\n';
}

void rotate(const Options& options) {
  const PublicKey successor = load_public_key(options.successor);
  const std::string out = options.out.empty() ? successor.name + ".rotation" : options.out;
  if (!is_rotation(out)) throw InputError(out + ": expected a name that ends in .rotation");
  write_text(out, rotation_statement(load_secret_key(options.file), successor));
  std::cout << "written: " << out << " (for `clamber key pin` on every robot)\n";
}

CLI::App* add(CLI::App& key, const char* name, const char* what,
              const std::shared_ptr<Options>& options, void (*run)(const Options&)) {
  CLI::App* command = key.add_subcommand(name, what);
  command->callback([options, run] { run(*options); });
  return command;
}

}  // namespace

void add_key_command(CLI::App& app) {
  CLI::App* key = app.add_subcommand("key", "Keys that sign bundles, and those a robot trusts");
  key->require_subcommand(1);
  const auto options = std::make_shared<Options>();
  const auto with_root = [&](CLI::App* command) {
    command->add_option("--root", options->root, "the robot's file system")->capture_default_str();
  };
  CLI::App* command = add(*key, "new", "Makes a key: FILE and FILE.pub", options, make);
  command->add_option("file", options->file, "for the secret key; must not exist")->required();
  command->add_option("--name", options->name, "for people (the file's name)");
  command = add(*key, "show", "A public key's id, or the keys that are pinned", options, show);
  command->add_option("file", options->file, "FILE.pub (else the pinned ones)");
  with_root(command);
  command = add(*key, "pin", "From now on bundles signed by this key are taken", options, pin);
  command->add_option("file", options->file, "FILE.pub, or a .rotation")->required();
  with_root(command);
  command = add(*key, "unpin", "Bundles signed by this key are not taken any more", options, unpin);
  command->add_option("id", options->file, "as `clamber key show` has it")->required();
  with_root(command);
  command = add(*key, "rotate", "States that another key takes this one's place", options, rotate);
  command->add_option("--key", options->file, "the old secret key")->required();
  command->add_option("--to", options->successor, "the new public key")->required();
  command->add_option("-o,--out", options->out, "statement (NAME.rotation)");
  key->footer(
      "Ed25519. A robot trusts the keys in ROOT/etc/clamber/keys. Exit codes: 0 done, 2 "
      "refused.\n\n"
      "Examples:\n"
      "  clamber key new ~/.config/clamber/release        once, where bundles are made\n"
      "  clamber key pin release.pub                      once, on the robot\n"
      "  clamber key rotate --key release --to next.pub   before the old key retires\n"
      "  clamber key pin next.rotation                    on every robot that trusts the old one");
}

}  // namespace clamber
