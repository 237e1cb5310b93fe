// Builds the page into one file, dist/index.html, that fetches nothing.
import { existsSync, readdirSync, readFileSync } from "node:fs";
import { defineConfig } from "vite";

/** The licences of the packages that are part of the page, which ask to be kept with it. */
function licences(bundle) {
  const packages = new Set();
  for (const part of Object.values(bundle))
    for (const module of Object.keys(part.modules ?? {})) {
      const found = module.match(/(\/[^\0]*\/node_modules\/((?:@[^/]+\/)?[^/]+))\//);
      if (found) packages.add(found[1]);
    }
  let text = "";
  for (const folder of [...packages].sort()) {
    const { name, version, license } = JSON.parse(readFileSync(`${folder}/package.json`));
    text += `\n${name} ${version}, ${license}\n`;
    const file = readdirSync(folder).find((each) => /^licen[cs]e/i.test(each));
    if (file && existsSync(`${folder}/${file}`)) text += readFileSync(`${folder}/${file}`, "utf8");
  }
  return text.replaceAll("--", "- -");
}

const inline = {
  name: "inline-everything",
  enforce: "post",
  generateBundle(_, bundle) {
    const page = bundle["index.html"];
    let html = page.source.replace(
      "<head>",
      () => `<head>\n<!-- Contains, beside Clamber's own code (Apache-2.0):\n${licences(bundle)}-->`,
    );
    for (const [name, part] of Object.entries(bundle)) {
      if (part.type === "chunk") {
        // A module script runs after the page is parsed, wherever it stands.
        const code = part.code.replaceAll("</script", "<\\/script");
        html = html.replace(new RegExp(`<script[^>]*src="[^"]*${name}"[^>]*></script>`), () => `<script type="module">${code}</script>`);
        delete bundle[name];
      } else if (name.endsWith(".css")) {
        html = html.replace(new RegExp(`<link[^>]*href="[^"]*${name}"[^>]*>`), () => `<style>${part.source}</style>`);
        delete bundle[name];
      }
    }
    page.source = html;
  },
};

export default defineConfig({
  base: "./",
  logLevel: "warn",
  build: {
    target: "es2022",
    assetsInlineLimit: 1 << 20,
    cssCodeSplit: false,
    modulePreload: false,
    chunkSizeWarningLimit: 2000,
  },
  plugins: [inline],
});
