// The manual page and the shell completion, written from what the commands say of themselves.
// Tool; allocates.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace clamber {

/// man(7) source of clamber(1): every command with its options and what --help says below them.
[[nodiscard]] std::string man_page(const CLI::App& app);
/// For bash: commands, subcommands, options; files elsewhere.
[[nodiscard]] std::string bash_completion(const CLI::App& app);

/// `clamber pages man|bash`, not listed by --help: the package's build calls it.
void add_pages_command(CLI::App& app);

}  // namespace clamber
