// Calls to the server, and the states of runs that it sends.

import { h } from "./elements.js";

let key = sessionStorage.getItem("key");

const fault = async (answer) => {
  const reply = await answer.json().catch(() => ({}));
  return Object.assign(new Error(reply.error ?? `the server answers ${answer.status}`), { status: answer.status });
};

// Takes the key out of the address, so that it is neither in the history nor in a bookmark.
export const enter = async () => {
  const [, given] = location.hash.match(/^#([0-9a-f]{32})$/) ?? [];
  if (given) {
    history.replaceState(null, "", "#/files");
    const answer = await fetch("/api/session", { method: "POST", body: JSON.stringify({ key: given }) });
    if (answer.ok) key = (await answer.json()).key;
    else if (!key) throw await fault(answer);
    sessionStorage.setItem("key", key);
  }
  if (!key) throw new Error("This address has no key. Open the one that deflex studio printed when it was started.");
};

const call = async (path, { method = "GET", body, headers = {} } = {}) => {
  const answer = await fetch(path, { method, body, headers: { "x-deflex-key": key, ...headers } });
  if (!answer.ok) throw await fault(answer);
  return answer;
};

export const get = async (path) => (await call(path)).json();
export const post = async (path, body) => (await call(path, { method: "POST", body: JSON.stringify(body) })).json();
export const remove = async (path) => (await call(path, { method: "DELETE" })).json();

const fileAt = (name) => `/api/file?name=${encodeURIComponent(name)}`;

// The text of a file, and its version.
export const read = async (name) => {
  const answer = await call(fileAt(name));
  return { text: await answer.text(), version: answer.headers.get("etag") };
};
export const readJson = async (name) => JSON.parse((await read(name)).text);

// Writes a file whole; `expected` is its version, "new" where there must be none, or "any". The new version.
export const write = async (name, body, expected) => {
  const headers = expected === "new" ? { "if-none-match": "*" } : { "if-match": expected === "any" ? "*" : expected };
  return (await (await call(fileAt(name), { method: "PUT", body, headers })).json()).version;
};

// A frame with the page of a result, in an origin of its own.
export const frame = async (name) => {
  const { address } = await post("/api/page", { name });
  return h("iframe", { src: address, title: `Page ${name}`, sandbox: "allow-scripts", className: "result" });
};

// Runs.

export const jobs = new Map();
const listeners = new Set();

// Calls back at each change of a run, until the function that it gives is called.
export const listen = (callback) => {
  listeners.add(callback);
  return () => listeners.delete(callback);
};
const inform = (job) => listeners.forEach((callback) => callback(job));

const take = (job) => {
  jobs.set(job.id, { ...jobs.get(job.id), ...job });
  inform(jobs.get(job.id));
};

const hear = (event) => {
  if (event.missed) return reload();
  if (event.job) return take(event.job);
  const job = jobs.get(event.id);
  if (!job) return undefined;
  if ("progress" in event.message) job.progress = event.message;
  else job.messages.push(event.message);
  return inform(job);
};

const reload = async () => (await get("/api/jobs")).jobs.forEach(take);

// Hears of runs for as long as the page is open. `lost` learns whether the server is there.
export const follow = async (lost) => {
  for (;;) {
    try {
      const answer = await call("/api/events");
      await reload();
      lost(false);
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      let rest = "";
      for (let part = await reader.read(); !part.done; part = await reader.read()) {
        const events = (rest + part.value).split("\n\n");
        rest = events.pop();
        for (const event of events.filter((text) => text.startsWith("data: "))) hear(JSON.parse(event.slice(6)));
      }
    } catch (error) {
      lost(error);
    }
    await new Promise((done) => setTimeout(done, 1000));
  }
};

// Starts a run, and gives it when it has ended; `started` gets it before.
export const run = async (what, started) => {
  const { job: { id }, job } = await post("/api/jobs", what);
  if (!jobs.has(id)) take(job);
  started?.(jobs.get(id));
  return new Promise((done) => {
    const stop = listen((changed) => ended(changed.id === id));
    const ended = (ours) => {
      if (!ours || jobs.get(id).state === "running") return;
      stop();
      done(jobs.get(id));
    };
    ended(true);
  });
};

export const cancel = (id) => remove(`/api/jobs/${id}`);

// Whether a run came to an answer.
export const succeeded = (job) => job.state === "done" && job.code !== 2;
