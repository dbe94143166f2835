// The time that is shown: it follows a flight under way, or is played and sought in.
"use strict";
class Clock {
  constructor(page) {
    this.page = page;
    this.time_s = NaN;
    this.following = true;
    this.playing = true;
    this.speed = 1;
    this.rate = 1;
  }

  isLive() { return this.page.state === "live" || this.page.state === "silent"; }

  toggle() {
    const { store } = this.page;
    if (!this.playing && this.time_s >= store.last_s - 0.01 && !this.isLive()) this.time_s = store.first_s;
    this.playing = !this.playing;
    this.following = false;
  }

  seek(time_s) {
    this.following = false;
    this.time_s = Math.min(this.page.store.last_s, Math.max(this.page.store.first_s, time_s));
    this.page.wantDetail();
  }

  goLive() { this.following = true; this.playing = true; this.time_s = this.page.store.last_s; }

  advance(wall_s) {
    const { store } = this.page, last = store.last_s;
    if (!Number.isFinite(last)) return;
    if (Number.isNaN(this.time_s)) { this.time_s = this.isLive() ? last : store.first_s; this.playing = true; this.following = this.isLive(); }
    if (this.following && this.isLive()) {
      const behind = last - this.time_s, pace = Math.max(this.rate, 0.1);
      this.time_s = behind > 1.5 * pace || behind < 0 ? last : Math.min(last, this.time_s + wall_s * pace * (behind > 0.3 * pace ? 1.1 : 0.95));
    } else if (this.playing) {
      this.time_s = Math.min(last, this.time_s + wall_s * this.speed);
      if (this.time_s >= last && !this.isLive()) this.playing = false;
    }
  }

  // How fast the flight goes, by what arrives.
  arrived(last_s, wall_s) {
    if (this.before && wall_s > this.before.wall_s + 0.3) {
      const rate = (last_s - this.before.last_s) / (wall_s - this.before.wall_s);
      this.rate = 0.5 * this.rate + 0.5 * rate;
      this.before = null;
    }
    this.before = this.before || { last_s, wall_s };
  }
}
