// SPDX-License-Identifier: MIT
// resolve.mjs - pages import each other by their addresses, "./space.js", and tests import them as "/space.js": for node these are files of panel/. And the little of a browser that a page asks for while it is loaded.
import { register } from "node:module";

globalThis.localStorage = { getItem: () => null, setItem() {} };
if (!globalThis.navigator?.language) Object.defineProperty(globalThis, "navigator", { value: { language: "en" }, configurable: true });

const hook = `export async function resolve(name, context, next) {
  const isPage = /^\\.?\\/[\\w-]+\\.js$/.test(name);
  return isPage ? { url: new URL("../../../panel" + name.replace(/^\\./, ""), ${JSON.stringify(import.meta.url)}).href, format: "module", shortCircuit: true } : next(name, context);
}`;
register(`data:text/javascript,${encodeURIComponent(hook)}`);
