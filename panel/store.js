// SPDX-License-Identifier: MIT
// store.js - what this browser keeps for the pages. One that forbids it, or has no room, keeps it until the page is closed: HOLD does not depend on it.
const kept = new Map();

function attempt(action) {
  try {
    return action(window.localStorage);
  } catch {
    return undefined;
  }
}

export const store = {
  get: (name) => kept.get(name) ?? attempt((storage) => storage.getItem(name)) ?? null,
  set(name, text) {
    const isKept = attempt((storage) => { storage.setItem(name, text); return true; }) ?? false;
    if (isKept) kept.delete(name);
    else kept.set(name, text);
  },
  remove(name) {
    kept.delete(name);
    attempt((storage) => storage.removeItem(name));
  },
};
