// The message bar at the bottom of the map; it shows one message at a time.

let timer;
export function tell(message, stay = false) {
  const bar = document.getElementById('message');
  bar.querySelector('p').textContent = message;
  bar.hidden = false;
  clearTimeout(timer);
  if (!stay) timer = setTimeout(() => { bar.hidden = true; }, 9000);
}
export function failed(error) {
  if (error?.name === 'AbortError') return;
  if (error?.status === undefined) console.error(error);
  tell(error?.message ?? String(error));
}
