//! A disk in memory that SQLite writes through its own interface for file systems. What a file was synced with is safe; of
//! what came later a power cut leaves any part, sector by sector.

use std::collections::HashMap;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ptr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rusqlite::ffi;
use tandem_rig::Random;

/// What a disk writes at once.
const SECTOR: usize = 512;
/// SQLite maps shared memory in regions of this size.
const REGION: usize = 32 * 1024;

#[derive(Clone)]
enum Unsynced {
    Write(usize, Vec<u8>),
    Truncate(usize),
}

#[derive(Default)]
struct File {
    now: Vec<u8>,
    safe: Vec<u8>,
    unsynced: Vec<Unsynced>,
    /// Its name in the folder is safe.
    named: bool,
    shared: Vec<Box<[u8]>>,
}

#[derive(Default)]
struct Inside {
    files: HashMap<String, File>,
    /// Deleted without the folder being synced: they may come back.
    deleted: Vec<(String, File)>,
    operations_left: Option<u64>,
    max_bytes: Option<usize>,
    read_only: bool,
    cut: bool,
}

impl Inside {
    /// One operation that reaches the disk; false where there is no power.
    fn operate(&mut self) -> bool {
        if let Some(left) = &mut self.operations_left {
            *left = left.saturating_sub(1);
            self.cut |= *left == 0;
        }
        !self.cut
    }

    fn bytes(&self) -> usize {
        self.files.values().map(|file| file.now.len()).sum()
    }

    fn sync_folder(&mut self) {
        self.deleted.clear();
        self.files.values_mut().for_each(|file| file.named = true);
    }
}

fn apply(content: &mut Vec<u8>, from: usize, bytes: &[u8]) {
    if content.len() < from + bytes.len() {
        content.resize(from + bytes.len(), 0);
    }
    content[from..from + bytes.len()].copy_from_slice(bytes);
}

/// The disk, registered with SQLite under its name for the rest of the process.
pub struct Disk {
    name: String,
    inside: Arc<Mutex<Inside>>,
}

fn lock(inside: &Mutex<Inside>) -> MutexGuard<'_, Inside> {
    inside.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Disk {
    pub fn new(name: &str) -> Self {
        let inside = Arc::new(Mutex::new(Inside::default()));
        let text = CString::new(name).unwrap();
        // SAFETY: SQLite's own layer lives for ever; ours is leaked, because SQLite keeps the pointer.
        unsafe {
            ffi::sqlite3_initialize();
            let default = ffi::sqlite3_vfs_find(ptr::null());
            let vfs = ffi::sqlite3_vfs {
                szOsFile: size_of::<Open>() as c_int,
                pNext: ptr::null_mut(),
                zName: text.into_raw(),
                pAppData: Arc::into_raw(Arc::clone(&inside)).cast_mut().cast(),
                xOpen: Some(open),
                xDelete: Some(delete),
                xAccess: Some(access),
                xFullPathname: Some(full_path),
                ..*default
            };
            assert_eq!(
                ffi::sqlite3_vfs_register(Box::into_raw(Box::new(vfs)), 0),
                ffi::SQLITE_OK
            );
        }
        Self {
            name: name.to_owned(),
            inside,
        }
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// The power goes with the `count`th operation from now.
    pub fn cut_after(&self, count: u64) {
        lock(&self.inside).operations_left = Some(count);
    }

    pub fn is_cut(&self) -> bool {
        lock(&self.inside).cut
    }

    /// The computer starts again.
    pub fn power_on(&self, random: &mut Random) {
        let mut inside = lock(&self.inside);
        (inside.cut, inside.operations_left) = (false, None);
        let deleted = std::mem::take(&mut inside.deleted);
        for (name, file) in deleted {
            if file.named && random.unit() < 0.5 {
                inside.files.entry(name).or_insert(file);
            }
        }
        // In a fixed order, so that a seed says the same again.
        let mut names: Vec<_> = inside.files.keys().cloned().collect();
        names.sort();
        for name in names {
            let file = inside.files.get_mut(&name).unwrap();
            if !file.named && random.unit() < 0.5 {
                inside.files.remove(&name);
                continue;
            }
            let mut content = std::mem::take(&mut file.safe);
            for operation in std::mem::take(&mut file.unsynced) {
                match operation {
                    Unsynced::Truncate(length) if random.unit() < 0.5 => content.truncate(length),
                    Unsynced::Truncate(_) => {}
                    Unsynced::Write(from, bytes) => {
                        let mut at = 0;
                        while at < bytes.len() {
                            let end = bytes.len().min(at + SECTOR - (from + at) % SECTOR);
                            if random.unit() < 0.5 {
                                apply(&mut content, from + at, &bytes[at..end]);
                            }
                            at = end;
                        }
                    }
                }
            }
            (file.now, file.safe, file.named) = (content.clone(), content, true);
            file.shared.clear();
        }
    }

    pub fn bytes(&self) -> usize {
        lock(&self.inside).bytes()
    }

    pub fn hold_at_most(&self, bytes: usize) {
        lock(&self.inside).max_bytes = Some(bytes);
    }

    pub fn read_only(&self) {
        lock(&self.inside).read_only = true;
    }
}

/// An open file as SQLite holds it.
#[repr(C)]
struct Open {
    base: ffi::sqlite3_file,
    inside: *const Mutex<Inside>,
    name: *mut String,
    /// SQLite's own layer syncs the folder with the first sync of a journal that it has made.
    names_folder: bool,
    gone_at_close: bool,
}

static METHODS: ffi::sqlite3_io_methods = ffi::sqlite3_io_methods {
    iVersion: 2,
    xClose: Some(close),
    xRead: Some(read),
    xWrite: Some(write),
    xTruncate: Some(truncate),
    xSync: Some(sync),
    xFileSize: Some(size),
    xLock: Some(any_lock),
    xUnlock: Some(any_lock),
    xCheckReservedLock: Some(reserved),
    xFileControl: Some(control),
    xSectorSize: Some(sector),
    xDeviceCharacteristics: Some(characteristics),
    xShmMap: Some(map),
    xShmLock: Some(map_lock),
    xShmBarrier: Some(barrier),
    xShmUnmap: Some(unmap),
    xFetch: None,
    xUnfetch: None,
};

/// SAFETY of all below: SQLite hands out the pointers that `Disk::new` and `open` gave it, to one thread at a time.
unsafe fn on<T>(
    file: *mut ffi::sqlite3_file,
    act: impl FnOnce(&mut Inside, &str, &mut Open) -> T,
) -> T {
    let file = unsafe { &mut *file.cast::<Open>() };
    let (inside, name) = unsafe { (&*file.inside, &*file.name) };
    act(&mut lock(inside), name, file)
}

unsafe fn text(name: *const c_char) -> String {
    unsafe { CStr::from_ptr(name) }.to_str().unwrap().to_owned()
}

unsafe fn of_vfs<'a>(vfs: *mut ffi::sqlite3_vfs) -> MutexGuard<'a, Inside> {
    lock(unsafe { &*(*vfs).pAppData.cast::<Mutex<Inside>>() })
}

unsafe extern "C" fn open(
    vfs: *mut ffi::sqlite3_vfs,
    name: ffi::sqlite3_filename,
    file: *mut ffi::sqlite3_file,
    flags: c_int,
    out_flags: *mut c_int,
) -> c_int {
    let mut inside = unsafe { of_vfs(vfs) };
    let opened = file.cast::<Open>();
    unsafe { (*opened).base.pMethods = ptr::null() };
    if inside.cut {
        return ffi::SQLITE_IOERR;
    }
    let name = if name.is_null() {
        format!("temporary-{}", inside.files.len())
    } else {
        unsafe { text(name) }
    };
    let is_new = !inside.files.contains_key(&name);
    if is_new && (flags & ffi::SQLITE_OPEN_CREATE == 0 || inside.read_only) {
        return ffi::SQLITE_CANTOPEN;
    }
    let journals =
        ffi::SQLITE_OPEN_WAL | ffi::SQLITE_OPEN_MAIN_JOURNAL | ffi::SQLITE_OPEN_SUPER_JOURNAL;
    if !out_flags.is_null() {
        let read_only = inside.read_only;
        let given = if read_only {
            flags & !ffi::SQLITE_OPEN_READWRITE | ffi::SQLITE_OPEN_READONLY
        } else {
            flags
        };
        unsafe { *out_flags = given };
    }
    inside.files.entry(name.clone()).or_default();
    let names_folder = is_new && flags & journals != 0;
    let gone_at_close = flags & ffi::SQLITE_OPEN_DELETEONCLOSE != 0;
    let base = ffi::sqlite3_file {
        pMethods: &raw const METHODS,
    };
    let disk = unsafe { (*vfs).pAppData }
        .cast::<Mutex<Inside>>()
        .cast_const();
    let name = Box::into_raw(Box::new(name));
    unsafe {
        opened.write(Open {
            base,
            inside: disk,
            name,
            names_folder,
            gone_at_close,
        });
    };
    ffi::SQLITE_OK
}

unsafe extern "C" fn delete(
    vfs: *mut ffi::sqlite3_vfs,
    name: *const c_char,
    sync_folder: c_int,
) -> c_int {
    let mut inside = unsafe { of_vfs(vfs) };
    if !inside.operate() {
        return ffi::SQLITE_IOERR_DELETE;
    }
    let name = unsafe { text(name) };
    let Some(file) = inside.files.remove(&name) else {
        return ffi::SQLITE_IOERR_DELETE_NOENT;
    };
    inside.deleted.push((name, file));
    if sync_folder != 0 {
        inside.sync_folder();
    }
    ffi::SQLITE_OK
}

unsafe extern "C" fn access(
    vfs: *mut ffi::sqlite3_vfs,
    name: *const c_char,
    _: c_int,
    out: *mut c_int,
) -> c_int {
    let inside = unsafe { of_vfs(vfs) };
    let is_there = inside
        .files
        .get(&unsafe { text(name) })
        .is_some_and(|file| !file.now.is_empty());
    unsafe { *out = c_int::from(is_there) };
    ffi::SQLITE_OK
}

unsafe extern "C" fn full_path(
    _: *mut ffi::sqlite3_vfs,
    name: *const c_char,
    room: c_int,
    out: *mut c_char,
) -> c_int {
    let bytes = unsafe { CStr::from_ptr(name) }.to_bytes_with_nul();
    if bytes.len() > room as usize {
        return ffi::SQLITE_CANTOPEN;
    }
    unsafe { ptr::copy_nonoverlapping(bytes.as_ptr().cast(), out, bytes.len()) };
    ffi::SQLITE_OK
}

unsafe extern "C" fn close(file: *mut ffi::sqlite3_file) -> c_int {
    unsafe {
        on(file, |inside, name, file| {
            if file.gone_at_close {
                inside.files.remove(name);
            }
        });
        drop(Box::from_raw((*file.cast::<Open>()).name));
    }
    ffi::SQLITE_OK
}

unsafe extern "C" fn read(
    file: *mut ffi::sqlite3_file,
    to: *mut c_void,
    count: c_int,
    from: i64,
) -> c_int {
    unsafe {
        on(file, |inside, name, _| {
            if inside.cut {
                return ffi::SQLITE_IOERR_READ;
            }
            let to = std::slice::from_raw_parts_mut(to.cast::<u8>(), count as usize);
            let there = inside.files.get(name).map_or(&[][..], |file| &file.now);
            let there = there.get(from as usize..).unwrap_or_default();
            let got = there.len().min(to.len());
            to[..got].copy_from_slice(&there[..got]);
            to[got..].fill(0);
            if got == to.len() {
                ffi::SQLITE_OK
            } else {
                ffi::SQLITE_IOERR_SHORT_READ
            }
        })
    }
}

unsafe extern "C" fn write(
    file: *mut ffi::sqlite3_file,
    bytes: *const c_void,
    count: c_int,
    from: i64,
) -> c_int {
    unsafe {
        on(file, |inside, name, _| {
            if !inside.operate() {
                return ffi::SQLITE_IOERR_WRITE;
            }
            let bytes = std::slice::from_raw_parts(bytes.cast::<u8>(), count as usize);
            let from = from as usize;
            let total = inside.bytes();
            let most = inside.max_bytes.unwrap_or(usize::MAX);
            let file = inside.files.entry(name.to_owned()).or_default();
            let grows = (from + bytes.len()).saturating_sub(file.now.len());
            if total.saturating_add(grows) > most {
                return ffi::SQLITE_FULL;
            }
            apply(&mut file.now, from, bytes);
            file.unsynced.push(Unsynced::Write(from, bytes.to_vec()));
            ffi::SQLITE_OK
        })
    }
}

unsafe extern "C" fn truncate(file: *mut ffi::sqlite3_file, length: i64) -> c_int {
    unsafe {
        on(file, |inside, name, _| {
            if !inside.operate() {
                return ffi::SQLITE_IOERR_TRUNCATE;
            }
            let file = inside.files.entry(name.to_owned()).or_default();
            file.now.truncate(length as usize);
            file.unsynced.push(Unsynced::Truncate(length as usize));
            ffi::SQLITE_OK
        })
    }
}

unsafe extern "C" fn sync(file: *mut ffi::sqlite3_file, _: c_int) -> c_int {
    unsafe {
        on(file, |inside, name, open| {
            if !inside.operate() {
                return ffi::SQLITE_IOERR_FSYNC;
            }
            let file = inside.files.entry(name.to_owned()).or_default();
            file.safe.clone_from(&file.now);
            file.unsynced.clear();
            if std::mem::take(&mut open.names_folder) {
                inside.sync_folder();
            }
            ffi::SQLITE_OK
        })
    }
}

unsafe extern "C" fn size(file: *mut ffi::sqlite3_file, out: *mut i64) -> c_int {
    unsafe {
        on(file, |inside, name, _| {
            *out = inside
                .files
                .get(name)
                .map_or(0, |file| file.now.len() as i64);
        });
    }
    ffi::SQLITE_OK
}

/// There is one connection.
unsafe extern "C" fn any_lock(_: *mut ffi::sqlite3_file, _: c_int) -> c_int {
    ffi::SQLITE_OK
}

unsafe extern "C" fn reserved(_: *mut ffi::sqlite3_file, out: *mut c_int) -> c_int {
    unsafe { *out = 0 };
    ffi::SQLITE_OK
}

unsafe extern "C" fn control(_: *mut ffi::sqlite3_file, _: c_int, _: *mut c_void) -> c_int {
    ffi::SQLITE_NOTFOUND
}

unsafe extern "C" fn sector(_: *mut ffi::sqlite3_file) -> c_int {
    SECTOR as c_int
}

/// As SQLite's own layer says of disks: what lies beside the bytes that are written stays.
unsafe extern "C" fn characteristics(_: *mut ffi::sqlite3_file) -> c_int {
    ffi::SQLITE_IOCAP_POWERSAFE_OVERWRITE
}

unsafe extern "C" fn map(
    file: *mut ffi::sqlite3_file,
    region: c_int,
    _: c_int,
    extend: c_int,
    out: *mut *mut c_void,
) -> c_int {
    unsafe {
        on(file, |inside, name, _| {
            let file = inside.files.entry(name.to_owned()).or_default();
            while extend != 0 && file.shared.len() <= region as usize {
                file.shared.push(vec![0; REGION].into_boxed_slice());
            }
            *out = file
                .shared
                .get_mut(region as usize)
                .map_or(ptr::null_mut(), |region| region.as_mut_ptr().cast());
        });
    }
    ffi::SQLITE_OK
}

unsafe extern "C" fn map_lock(_: *mut ffi::sqlite3_file, _: c_int, _: c_int, _: c_int) -> c_int {
    ffi::SQLITE_OK
}

unsafe extern "C" fn barrier(_: *mut ffi::sqlite3_file) {}

unsafe extern "C" fn unmap(_: *mut ffi::sqlite3_file, _: c_int) -> c_int {
    ffi::SQLITE_OK
}
