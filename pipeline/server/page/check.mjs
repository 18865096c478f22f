// Rebuilds the page into a temporary folder and compares it with dist, byte for byte.

import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, readdirSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const room = dirname(fileURLToPath(import.meta.url));
const fresh = mkdtempSync(join(tmpdir(), 'sastrugi-page-'));
try {
  execFileSync(process.execPath, [join(room, 'build.mjs'), fresh], { stdio: 'inherit' });
  const kept = join(room, 'dist');
  const names = [...new Set([...readdirSync(fresh), ...readdirSync(kept)])].sort();
  const read = (folder, name) => { try { return readFileSync(join(folder, name)); } catch { return Buffer.from('absent'); } };
  const different = names.filter((name) => !read(fresh, name).equals(read(kept, name)));
  if (different.length) {
    console.error(`dist is out of date: ${different.join(', ')}. Run \`npm run build\` and commit dist.`);
    process.exitCode = 1;
  } else console.log(`dist is up to date: ${names.join(', ')}`);
} finally {
  rmSync(fresh, { recursive: true, force: true });
}
