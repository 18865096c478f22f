// Requests to the server. A refusal becomes a Problem with the message that the server sent.

export class Problem extends Error {
  constructor(status, detail) { super(detail); this.status = status; }
}

const KEY = 'sastrugi-token';
let token = read();
let asking = null;

function read() {
  try { return sessionStorage.getItem(KEY); } catch { return null; }
}

/** Asks for the token once, even if several requests were refused at the same time. */
function ask() {
  asking ??= new Promise((resolve) => {
    const dialog = document.getElementById('token');
    dialog.addEventListener('close', () => {
      token = dialog.querySelector('input').value.trim() || null;
      try { if (token) sessionStorage.setItem(KEY, token); } catch { /* kept for this page only */ }
      asking = null;
      resolve();
    }, { once: true });
    dialog.showModal();
  });
  return asking;
}

export function query(parameters) {
  const parts = Object.entries(parameters)
    .filter(([, value]) => value !== null && value !== undefined)
    .map(([name, value]) => `${name}=${encodeURIComponent(value).replaceAll('%2C', ',').replaceAll('%3B', ';')}`);
  return parts.length ? `?${parts.join('&')}` : '';
}

export async function get(path, signal) {
  const sent = token;
  let response;
  try {
    response = await fetch(path, { signal, headers: sent ? { Authorization: `Bearer ${sent}` } : {} });
  } catch (error) {
    if (error.name === 'AbortError') throw error;
    throw new Problem(0, 'The server is not responding; check that it is still running.');
  }
  if (response.status === 401) {
    if (token === sent) await ask();
    if (token) return get(path, signal);
  }
  if (!response.ok) throw await problem(response);
  return response;
}

async function problem(response) {
  let detail = `The server answered ${response.status} ${response.statusText}.`;
  try {
    const body = await response.json();
    detail = body.detail || body.title || detail;
  } catch { /* no problem details in the body */ }
  const told = new Problem(response.status, detail);
  told.retry = Number(response.headers.get('Retry-After')) || 1;
  return told;
}

export const json = async (path, signal) => (await get(path, signal)).json();
export const base = (collection) => `/v1/collections/${encodeURIComponent(collection.id)}`;
